"""A thing by its number: object k of seed s, the same however many are asked for.

Its kind is the first draw from the stream of (s, k); sizes, pose and density follow from it too. It is put down
upright, on its side or upside down as its kind allows, and settles as every object does (`meshes.resting`). Its
longest side is from 15 mm to 25 cm and its mass from 10 g to 1.5 kg: what comes out beyond is scaled, and its mass
cut off. Its mesh is the surfaces of its convex parts, so the depth sensor sees what the hand touches.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesgrasp.meshes.convex import ConvexPart, hull_part
from bayesgrasp.meshes.mass import mass_properties
from bayesgrasp.meshes.mesh import signed_volume
from bayesgrasp.meshes.resting import rest
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.objects.procedural.kinds import KINDS, Kind, draw_kind
from bayesgrasp.objects.procedural.pieces import Draw, Pieces, X, Y, Z, rotated
from bayesgrasp.seeding import Stream, generator

LENGTH = (0.015, 0.25)
MASS = (0.010, 1.5)


@dataclass(frozen=True)
class Thing(ObjectAsset):
    """A procedural object; it goes to other processes by its number and is made again there.

    Attributes:
        seed, index: Its number.
    """

    seed: int = 0
    index: int = 0

    def __reduce__(self) -> tuple[Any, ...]:
        return make, (self.seed, self.index)


def make(seed: int, index: int) -> Thing:
    """Object ``index`` of ``seed``."""
    rng = generator(seed, Stream.PROCEDURAL, index)
    name = draw_kind(rng)
    kind, draw = KINDS[name], Draw(rng)
    pieces = _scaled(_put_down(kind.make(draw), kind, draw))
    resting = rest(tuple(hull_part(piece) for piece in pieces))
    parts = tuple(ConvexPart(resting.place(part.vertices), part.faces) for part in resting.parts)
    center, inertia = mass_properties(parts)
    volume = sum(signed_volume(part.vertices[part.faces]) for part in parts)
    mass = float(np.clip(draw.size(*kind.density) * volume, *MASS))
    first = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    faces = np.concatenate([part.faces + np.int32(start) for part, start in zip(parts, first, strict=True)])
    vertices = np.concatenate([part.vertices for part in parts])
    return Thing(
        f"{name}-{seed}-{index}",
        "procedural",
        "procedural",
        mass,
        vertices,
        faces,
        parts,
        center,
        inertia,
        seed=seed,
        index=index,
    )


def _put_down(pieces: Pieces, kind: Kind, draw: Draw) -> Pieces:
    """On its side, in one of four rolls, or upside down, as often as the kind is."""
    pose = draw.rng.random()
    if pose < kind.lies:
        return rotated(rotated(pieces, Z, 90.0 * draw.whole(0, 3)), Y, 90.0)
    return rotated(pieces, X, 180.0) if pose < kind.lies + kind.upside_down else pieces


def _scaled(pieces: Pieces) -> Pieces:
    longest = float(np.ptp(np.concatenate(pieces), axis=0).max())
    factor = float(np.clip(longest, *LENGTH)) / longest
    return [factor * piece for piece in pieces]
