"""Ways to damage a file: of its bytes, whatever they mean, and of the values in its JSON.

Every one is a function of the content and a random generator, so a case is known by its number and can be repeated.
"""

import json
from collections.abc import Callable
from typing import Any

import numpy as np

Mutation = Callable[[bytes, np.random.Generator], bytes]
EXTREME = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**63 - 1, 2**64 - 1)
"""Numbers at the ends of their types, as lengths and offsets like to be."""
STRANGE: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2**31, 2**63, 10**400, 0.0, -0.5, 1e-300, 1e30, 1e308, float("nan"), float("inf")),
    *("", "1", "x" * 10_000, "../../x", "\x1b[2J", "line\nbreak", "\ud800", "\x00", [], {}, [[]], [0] * 3, [1e9] * 3),
    *({"x": 1}, [None] * 9, [[0.0] * 3] * 3, ["1"] * 3, [True] * 3),
)
"""Values that are seldom right."""


def mutated(content: bytes, rng: np.random.Generator, is_json: bool) -> tuple[str, bytes]:
    """A damaged content, which is another one, and the name of the damage."""
    choices = BYTES | (VALUES if is_json else {})
    while True:
        name = str(rng.choice(list(choices)))
        damaged = choices[name](content, rng)
        if damaged != content:
            return name, damaged


def flip(content: bytes, rng: np.random.Generator) -> bytes:
    """One bit the other way round."""
    place, bit = divmod(int(rng.integers(8 * len(content))), 8)
    return content[:place] + bytes([content[place] ^ (1 << bit)]) + content[place + 1 :]


def flip_many(content: bytes, rng: np.random.Generator) -> bytes:
    """Up to thirty of them."""
    for _ in range(int(rng.integers(2, 30))):
        content = flip(content, rng)
    return content


def flip_in_header(content: bytes, rng: np.random.Generator) -> bytes:
    """One bit of the first hundred bytes, where lengths, types and shapes stand."""
    return flip(content[:100], rng) + content[100:]


def truncate(content: bytes, rng: np.random.Generator) -> bytes:
    """Only the beginning."""
    return content[: int(rng.integers(len(content)))]


def behead(content: bytes, rng: np.random.Generator) -> bytes:
    """Only the end."""
    return content[int(rng.integers(1, len(content))) :]


def remove(content: bytes, rng: np.random.Generator) -> bytes:
    """Without a piece of the middle."""
    start, end = sorted(rng.integers(len(content), size=2).tolist())
    return content[:start] + content[end:]


def repeat(content: bytes, rng: np.random.Generator) -> bytes:
    """A piece of the middle twice."""
    start, end = sorted(rng.integers(len(content), size=2).tolist())
    return content[:end] + content[start:end] + content[end:]


def swap(content: bytes, rng: np.random.Generator) -> bytes:
    """Two pieces in each other's place."""
    a, b, c = sorted(rng.integers(len(content) + 1, size=3).tolist())
    return content[:a] + content[b:c] + content[a:b] + content[c:]


def overwrite(content: bytes, rng: np.random.Generator) -> bytes:
    """Random bytes over a few of its own."""
    start = int(rng.integers(len(content)))
    noise = rng.bytes(int(rng.integers(1, 32)))
    return content[:start] + noise + content[start + len(noise) :]


def put_number(content: bytes, rng: np.random.Generator) -> bytes:
    """An extreme number where another one may have stood."""
    width, start = int(rng.choice([1, 2, 4, 8])), int(rng.integers(min(len(content), 400)))
    number: int = EXTREME[rng.integers(len(EXTREME))] % 256**width
    put = number.to_bytes(width, "little" if rng.random() < 0.5 else "big")
    return content[:start] + put + content[start + width :]


def append(content: bytes, rng: np.random.Generator) -> bytes:
    """More at the end."""
    return content + rng.bytes(int(rng.integers(1, 100)))


def replace_value(content: bytes, rng: np.random.Generator) -> bytes:
    """A strange value in the place of one."""
    return _edited(content, rng, lambda outer, key: outer.__setitem__(key, STRANGE[rng.integers(len(STRANGE))]))


def scale_number(content: bytes, rng: np.random.Generator) -> bytes:
    """A number times another, where there is one."""
    factor = float(rng.choice([-1.0, 0.5, 0.999, 1.001, 2.0, 1e3, 1e6, 1e300]))

    def scale(outer: Any, key: Any) -> None:
        if isinstance(outer[key], int | float) and not isinstance(outer[key], bool):
            outer[key] = outer[key] * factor

    return _edited(content, rng, scale)


def remove_value(content: bytes, rng: np.random.Generator) -> bytes:
    """One entry less."""
    return _edited(content, rng, lambda outer, key: outer.__delitem__(key))


def rename(content: bytes, rng: np.random.Generator) -> bytes:
    """An entry under another name."""

    def move(outer: Any, key: Any) -> None:
        if isinstance(outer, dict):
            outer[f"{key}x" if rng.random() < 0.5 else str(key)[:-1]] = outer.pop(key)

    return _edited(content, rng, move)


def nest(content: bytes, rng: np.random.Generator) -> bytes:
    """A value inside many lists."""
    depth = int(rng.choice([1, 2, 40, 900]))

    def wrap(outer: Any, key: Any) -> None:
        for _ in range(depth):
            outer[key] = [outer[key]]

    return _edited(content, rng, wrap)


def exchange(content: bytes, rng: np.random.Generator) -> bytes:
    """Two values in each other's place."""
    tree = json.loads(content)
    places = _places(tree)
    (a, i), (b, j) = (places[int(rng.integers(len(places)))] for _ in range(2))
    a[i], b[j] = b[j], a[i]
    try:
        return json.dumps(tree).encode()
    except ValueError:  # one was inside the other
        return content


def _edited(content: bytes, rng: np.random.Generator, edit: Callable[[Any, Any], None]) -> bytes:
    tree = json.loads(content)
    places = _places(tree)
    outer, key = places[int(rng.integers(len(places)))]
    edit(outer, key)
    return json.dumps(tree).encode()


def _places(tree: Any) -> list[tuple[Any, Any]]:
    """Every value of a tree, as what holds it and under which name or number."""
    found: list[tuple[Any, Any]] = []
    waiting = [tree]
    while waiting:
        outer = waiting.pop()
        keys = list(outer) if isinstance(outer, dict) else range(len(outer)) if isinstance(outer, list) else ()
        found += [(outer, key) for key in keys]
        waiting += [outer[key] for key in keys]
    return found


BYTES: dict[str, Mutation] = {
    mutation.__name__: mutation
    for mutation in (
        *(flip, flip_many, flip_in_header, truncate, behead, remove, repeat, swap, overwrite, put_number, append),
    )
}
VALUES: dict[str, Mutation] = {
    mutation.__name__: mutation for mutation in (replace_value, scale_number, remove_value, rename, nest, exchange)
}
