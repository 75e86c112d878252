"""Parametric solids: a closed mesh together with the convex parts that make it up, no decomposition needed.

Solids of revolution turn a profile of (radius, height) points about the z axis. Solid ones are cut at every height,
hollow ones into a floor and wall sectors, so that the cavity stays open. All lengths in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import trimesh
from jaxtyping import Float64

from bayesgrasp.meshes.convex import ConvexPart, hull_part
from bayesgrasp.meshes.mesh import Mesh

SEGMENTS = 40  # sides of a solid of revolution
SECTORS = 10  # convex sectors of a hollow wall; divides SEGMENTS
BALL_RINGS = 8  # rings of 16 corners: within 2 % of the radius of a true ellipsoid

Profile = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Solid:
    """A shape in a frame of its own, standing on its base with z upwards.

    Attributes:
        mesh: Closed surface; bodies that overlap (a mug and its handle) stay separate bodies of one mesh.
        parts: Convex parts that cover it.
    """

    mesh: Mesh
    parts: tuple[ConvexPart, ...]

    def __add__(self, other: Solid) -> Solid:
        faces = np.concatenate([self.mesh.faces, other.mesh.faces + np.int32(len(self.mesh.vertices))])
        mesh = Mesh(np.concatenate([self.mesh.vertices, other.mesh.vertices]), faces)
        return Solid(mesh, self.parts + other.parts)

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        """The same solid, translated."""
        offset = np.array([x, y, z])
        parts = tuple(ConvexPart(part.vertices + offset, part.faces) for part in self.parts)
        return Solid(Mesh(self.mesh.vertices + offset, self.mesh.faces), parts)


def hull(points: Float64[np.ndarray, "n 3"]) -> Solid:
    """The convex hull of points, which is its own only part."""
    part = hull_part(points)
    return Solid(Mesh(part.vertices, part.faces), (part,))


def box(x: float, y: float, z: float) -> Solid:
    """A box with these edges, centred above the origin."""
    corners = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (0.0, 1.0)])
    return hull(corners * (x, y, z))


def prism(radius: float, height: float, sides: int) -> Solid:
    """An upright regular prism."""
    return hull(np.concatenate([_ring(radius, 0.0, sides), _ring(radius, height, sides)]))


def wedge(x: float, y: float, z: float) -> Solid:
    """A ramp that rises along x from 0 to ``z``."""
    corners = [[-x / 2, -y / 2, 0], [-x / 2, y / 2, 0], [x / 2, -y / 2, 0], [x / 2, y / 2, 0]]
    return hull(np.array([*corners, [x / 2, -y / 2, z], [x / 2, y / 2, z]], np.float64))


def ellipsoid(x: float, y: float, z: float) -> Solid:
    """An ellipsoid with these diameters as a polyhedron, flat where it touches the table so that it does not tilt."""
    polar = (np.arange(BALL_RINGS) + 0.5) * np.pi / BALL_RINGS
    # The first and the last ring are half a step away from the poles: the lowest one is the flat foot.
    rings = [_ring(0.5 * np.sin(angle), 0.5 - 0.5 * np.cos(angle), 2 * BALL_RINGS) for angle in polar]
    return hull(np.concatenate(rings) * (x, y, z))


def turned(profile: Profile) -> Solid:
    """A solid of revolution from its base to its top; one part for each step of the profile, or fewer where convex."""
    rings = [_ring(radius, height, SEGMENTS) for radius, height in profile]
    parts = tuple(hull_part(np.concatenate(rings[a : b + 1])) for a, b in _convex_runs(profile))
    outline = [(0.0, profile[0][1]), *profile, (0.0, profile[-1][1])]
    return Solid(_revolved(outline), parts)


def hollow(outer: Profile, wall: float, floor: float) -> Solid:
    """An open vessel: ``outer`` is its outside from base to rim, ``wall`` and ``floor`` its thickness."""
    bottom = outer[0][1] + floor
    # Inside, the profile follows the outside at the wall's thickness, but never below the floor.
    inner = [(radius - wall, max(height, bottom)) for radius, height in outer]
    outline = [(0.0, outer[0][1]), *outer, *reversed(inner), (0.0, bottom)]
    foot = [(radius, height) for radius, height in outer if height < bottom]
    at_floor = (float(np.interp(bottom, [h for _, h in outer], [r for r, _ in outer])), bottom)
    base = hull_part(np.concatenate([_ring(radius, height, SEGMENTS) for radius, height in (*foot, at_floor)]))
    walls = [
        hull_part(
            np.concatenate(
                [
                    _arc(*outer[i], sector),
                    _arc(*outer[i + 1], sector),
                    _arc(*inner[i], sector),
                    _arc(*inner[i + 1], sector),
                ]
            )
        )
        for i in range(len(outer) - 1)
        for sector in range(SECTORS)
    ]
    return Solid(_revolved(outline), (base, *walls))


def handle(distance: float, bottom: float, top: float, reach: float, thickness: float, pieces: int = 5) -> Solid:
    """Half a ring that stands out along x from ``distance``, between two heights, with a square section."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, pieces + 1)
    half = (top - bottom) / 2
    centre = np.stack([distance + reach * np.cos(angle), np.zeros_like(angle), bottom + half + half * np.sin(angle)], 1)
    normal = np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)], 1)
    square = [(i, j) for i in (-0.5, 0.5) for j in (-0.5, 0.5)]
    sections = [
        [c + thickness * (i * n + j * np.array([0, 1, 0])) for i, j in square]
        for c, n in zip(centre, normal, strict=True)
    ]
    solid = hull(np.array(sections[0] + sections[1]))
    for start, end in pairwise(sections[1:]):
        solid = solid + hull(np.array(start + end))
    return solid


def _ring(radius: float, height: float, sides: int) -> Float64[np.ndarray, "n 3"]:
    angle = 2 * np.pi * np.arange(sides) / sides
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides, height)], axis=1)


def _arc(radius: float, height: float, sector: int) -> Float64[np.ndarray, "n 3"]:
    step = SEGMENTS // SECTORS
    ring = _ring(radius, height, SEGMENTS)
    return ring[np.arange(sector * step, (sector + 1) * step + 1) % SEGMENTS]


def _convex_runs(profile: Profile) -> list[tuple[int, int]]:
    """Longest runs of steps whose slope only turns inwards, as pairs of first and last point."""
    points = np.array(profile)
    steps = np.diff(points, axis=0)
    # Cross products of neighbouring steps; going up with the axis on the left, a right turn leaves the hull.
    turns = steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0]
    breaks = [0, *(np.flatnonzero(turns < -1e-12) + 1), len(profile) - 1]
    return [(int(a), int(b)) for a, b in pairwise(breaks)]


def _revolved(outline: Profile) -> Mesh:
    """Closed surface of an outline from axis to axis, anticlockwise in (radius, height), turned about z."""
    surface = trimesh.creation.revolve(np.array(outline, np.float64), sections=SEGMENTS)
    return Mesh(np.array(surface.vertices, np.float64), np.array(surface.faces, np.int32))
