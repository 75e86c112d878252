"""How procedural objects are named: ``procedural:N@SEED`` are the first N of a seed, ``bowl-7-12`` is its number 12.

An id begins with the kind of the thing, so that tables can be read; seed and index alone say which one it is.
"""

from __future__ import annotations

import re

from bayesgrasp.errors import AssetError, clipped
from bayesgrasp.objects.procedural.kinds import NAMES, draw_kind
from bayesgrasp.seeding import Stream, generator

SPLIT = "procedural"
FORM = f"{SPLIT}:N@SEED"
MOST_SEED = 2**63 - 1
MOST_OBJECTS = 100_000


def ids_of(split: str) -> tuple[str, ...] | None:
    """Ids of a split ``procedural:N@SEED``; None for any other name.

    Raises:
        AssetError: It begins so and goes on otherwise, or N or SEED is out of bounds.
    """
    if split != SPLIT and not split.startswith((f"{SPLIT}:", f"{SPLIT}@")):
        return None
    match = re.fullmatch(rf"{SPLIT}:([0-9]{{1,19}})@([0-9]{{1,19}})", split)
    if match is None:
        raise AssetError(f"'{clipped(split, 60)}' is no split; write {FORM}, for example {SPLIT}:200@7")
    count, seed = int(match[1]), int(match[2])
    if not (1 <= count <= MOST_OBJECTS and seed <= MOST_SEED):
        raise AssetError(f"'{split}': N must be from 1 to {MOST_OBJECTS}, SEED from 0 to {MOST_SEED}")
    return tuple(id_of(seed, index) for index in range(count))


def id_of(seed: int, index: int) -> str:
    """The id of object ``index`` of ``seed``; the object is not made for it."""
    return f"{draw_kind(generator(seed, Stream.PROCEDURAL, index))}-{seed}-{index}"


def number_of(object_id: str) -> tuple[int, int] | None:
    """Seed and index of an id of `id_of`; None for any other name.

    Raises:
        AssetError: Its kind is not that of the object with this number.
    """
    match = re.fullmatch(rf"({'|'.join(NAMES)})-([0-9]{{1,19}})-([0-9]{{1,6}})", object_id)
    if match is None or int(match[2]) > MOST_SEED or int(match[3]) >= MOST_OBJECTS:
        return None
    seed, index = int(match[2]), int(match[3])
    if (true := id_of(seed, index)) != object_id:
        raise AssetError(f"there is no object '{object_id}': object {index} of seed {seed} is '{true}'")
    return seed, index
