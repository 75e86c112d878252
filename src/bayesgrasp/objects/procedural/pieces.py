"""Convex pieces: the corners of each, from which things are put together, and random sizes for them.

Everything stands on z = 0 around the z axis, in metres, until it is moved, turned or stretched. Round sections are
polygons that have a side, not a corner, towards each axis, so that what lies down lies on a side.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

Corners = Float64[np.ndarray, "_ 3"]
Point = Float64[np.ndarray, "3"]
Pieces = list[Corners]
"""The corners of each piece; a piece is their convex hull."""

SIDES = 16  # of a solid of revolution: within 2 % of its radius
SECTORS = 12  # of walls and rings
BALL = (6, 12)  # rings of corners, and corners in each
X, Y, Z = np.eye(3)


class Draw:
    """Random sizes and choices of one thing.

    Args:
        rng: The stream of the thing.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def size(self, low: float, high: float) -> float:
        """A positive number, uniform in its logarithm."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def chance(self, share: float) -> bool:
        """True with this probability."""
        return bool(self.rng.random() < share)

    def whole(self, low: int, high: int) -> int:
        """A whole number from ``low`` to ``high``."""
        return int(self.rng.integers(low, high + 1))

    def shift(self, most: float) -> float:
        """A number from minus ``most`` to ``most``."""
        return float(self.rng.uniform(-most, most))


def block(x: float, y: float, z: float) -> Corners:
    """A box with these edges."""
    return np.array([[i * x, j * y, k * z] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (0.0, 1.0)])


def rounded(x: float, y: float, z: float, radius: float) -> Corners:
    """A box whose upright edges are cut off by ``radius``, at most 0.4 of the shorter side."""
    cut = min(radius, 0.4 * min(x, y))
    outline = [(x / 2 - cut, y / 2), (x / 2, y / 2 - cut)]
    corners = [(i * a, j * b) for a, b in outline for i in (-1, 1) for j in (-1, 1)]
    return prism(np.array(corners), z)


def prism(outline: Float64[np.ndarray, "_ 2"], z: float) -> Corners:
    """An upright prism over the convex hull of points of the plane."""
    lower = np.concatenate([outline, np.zeros((len(outline), 1))], axis=1)
    return np.concatenate([lower, lower + z * Z])


def ring(radius: float, height: float, sides: int = SIDES) -> Corners:
    """Corners of a regular polygon with sides at distance about ``radius``."""
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides, height)], axis=1)


def turned(profile: Sequence[tuple[float, float]], sides: int = SIDES) -> Pieces:
    """A solid of revolution through (radius, height) points, a piece for each step."""
    return [
        np.concatenate([ring(*start, sides), ring(*end, sides)])
        for start, end in pairwise(profile)
        if end[1] > start[1] + 1e-5
    ]


def ball(x: float, y: float, z: float) -> Corners:
    """An ellipsoid with these diameters, flat where it touches the table."""
    rings, sides = BALL
    polar = (np.arange(rings) + 0.5) * np.pi / rings
    # The lowest ring is half a step from the pole: the foot. Its height is stretched to the full diameter.
    height = np.cos(polar) / np.cos(polar[0])
    corners = [ring(0.5 * np.sin(p), 0.5 - 0.5 * h, sides) for p, h in zip(polar, height, strict=True)]
    return np.concatenate(corners) * (x, y, z)


def point(x: float, y: float, z: float) -> Point:
    """A point, or an offset between two."""
    return np.array([x, y, z])


def rod(start: Point, end: Point, radius: float, other: float | None = None, sides: int = 8) -> Corners:
    """A round bar between two points, ``radius`` thick at the start and ``other`` at the end."""
    axis = (end - start) / np.linalg.norm(end - start)
    across = np.cross(axis, Z if abs(axis[2]) < 0.9 else Y)
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(axis, across)])
    circle = ring(1.0, 0.0, sides)[:, :2] @ frame
    return np.concatenate([start + radius * circle, end + (radius if other is None else other) * circle])


def wall(lower: tuple[float, float], upper: tuple[float, float], thickness: float, sectors: int = SECTORS) -> Pieces:
    """A round wall from one (outer radius, height) to another."""
    rings = [ring(r, h, sectors) for radius, h in (lower, upper) for r in (radius, radius - thickness)]
    turn = np.roll(np.arange(sectors), -1)
    return [np.array([r[k] for r in rings for k in (i, j)]) for i, j in zip(range(sectors), turn, strict=True)]


def hoop(path: Corners, section: Float64[np.ndarray, "_ 3"], closed: bool = False) -> Pieces:
    """A bar along a path in the x-z plane; ``section`` holds its corners: outwards, along y, unused.

    Args:
        path: Points of the path.
        section: Offsets (outwards from the path's middle, along y, 0) of the corners of the bar's section.
        closed: Whether the last point is joined to the first.
    """
    middle = path.mean(axis=0)
    outwards = path - middle
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    cuts = [p + section[:, :1] * o + section[:, 1:2] * Y for p, o in zip(path, outwards, strict=True)]
    return [np.concatenate(pair) for pair in pairwise([*cuts, cuts[0]] if closed else cuts)]


def square(thickness: float, width: float | None = None) -> Float64[np.ndarray, "4 3"]:
    """The section of a bar for `hoop`: ``thickness`` outwards and ``width`` along y."""
    along = thickness if width is None else width
    return np.array([[i * thickness, j * along, 0.0] for i in (-0.5, 0.5) for j in (-0.5, 0.5)])


def arch(radius: float, height: float, pieces: int = 4) -> Corners:
    """The path of an arch of half width ``radius`` that rises by ``height`` from z = 0, in the x-z plane."""
    angle = np.linspace(0, np.pi, pieces + 1)
    return np.stack([radius * np.cos(angle), np.zeros_like(angle), height * np.sin(angle)], axis=1)


def moved(pieces: Pieces, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pieces:
    """The same pieces, translated."""
    return [piece + point(x, y, z) for piece in pieces]


def rotated(pieces: Pieces, axis: Point, degrees: float) -> Pieces:
    """The same pieces, turned about an axis of the frame."""
    angle = np.radians(degrees)
    x, y, z = axis
    hat = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation = np.eye(3) + np.sin(angle) * hat + (1 - np.cos(angle)) * hat @ hat
    return [piece @ rotation.T for piece in pieces]


def stretched(pieces: Pieces, factors: Sequence[float]) -> Pieces:
    """The same pieces under diag(factors)."""
    return [piece * np.asarray(factors) for piece in pieces]
