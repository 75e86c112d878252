"""Convex parts: what the physics engine collides with, each the hull of few points.

Starting from the extremes of a few directions, the point farthest outside the hull so far joins it, until none is
outside by more than ``tolerance`` or ``max_vertices`` are used. What is then still outside is shared equally between
both sides of the surface by pushing the hull outwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int32
from scipy.spatial import ConvexHull, QhullError

from bayesgrasp.errors import AssetError

FLAT = 1e-6  # metres; first corners no farther than this from a plane need another one to span a volume


@dataclass(frozen=True)
class ConvexPart:
    """A convex polyhedron, wound outwards.

    Attributes:
        vertices: Corners, metres; every one is a corner of the hull.
        faces: Triangles of the hull, counter-clockwise seen from outside.
    """

    vertices: Float64[np.ndarray, "v 3"]
    faces: Int32[np.ndarray, "f 3"]

    def halfspaces(self) -> tuple[Float64[np.ndarray, "f 3"], Float64[np.ndarray, " f"]]:
        """Outward unit normals n and offsets b of the faces: a point p is inside where n . p <= b for all faces."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return normals, np.einsum("ij,ij->i", normals, a)

    def depth(self, points: Float[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
        """Signed distance bound of points, metres: negative inside, and at most the distance outside."""
        normals, offsets = self.halfspaces()
        outside: Float64[np.ndarray, " n"] = (points @ normals.T - offsets).max(axis=1)
        return outside


def hull_part(points: Float64[np.ndarray, "n 3"], max_vertices: int = 10_000, tolerance: float = 0.0) -> ConvexPart:
    """The convex hull of points, thinned to ``max_vertices`` corners (see the module's docstring).

    Raises:
        AssetError: The points do not span a volume.
    """
    try:
        corners = points[ConvexHull(points).vertices]
        chosen, residual = _thin(corners, max_vertices, tolerance)
    except (QhullError, ValueError) as error:
        raise AssetError(f"{len(points)} points do not span a convex part with a volume") from error
    return _polyhedron(_grow(corners[chosen], residual / 2))


def _thin(
    corners: Float64[np.ndarray, "n 3"], max_vertices: int, tolerance: float
) -> tuple[Bool[np.ndarray, " n"], float]:
    """Greedy choice of corners, and how far the farthest corner left out lies outside their hull, metres."""
    chosen = np.zeros(len(corners), bool)
    if len(corners) <= max(8, max_vertices) and tolerance == 0:
        chosen[:] = True
        return chosen, 0.0
    first = _FIRST_DIRECTIONS[: max(max_vertices // 2, 6)]
    chosen[(corners @ first.T).argmax(axis=0)] = True
    _, spread, axes = np.linalg.svd(corners[chosen] - corners[chosen].mean(axis=0))
    if spread[-1] < FLAT:
        height = corners @ axes[-1]
        chosen[[height.argmin(), height.argmax()]] = True
    while True:
        hull = ConvexHull(corners[chosen])
        outside = (corners @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        outside[chosen] = 0.0
        residual = float(outside.max())
        if residual <= max(tolerance, 1e-9) or chosen.sum() >= max_vertices:
            return chosen, residual
        chosen[outside.argmax()] = True


def _grow(points: Float64[np.ndarray, "n 3"], distance: float) -> Float64[np.ndarray, "n 3"]:
    """Move corners of a hull away from its centre by ``distance``, metres."""
    if distance < 1e-6:
        return points
    outwards = points - points.mean(axis=0)
    moved: Float64[np.ndarray, "n 3"] = points + distance * outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
    return moved


def _polyhedron(points: Float64[np.ndarray, "n 3"]) -> ConvexPart:
    hull = ConvexHull(points)
    index = np.full(len(points), -1)
    index[hull.vertices] = np.arange(len(hull.vertices))
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return ConvexPart(points[hull.vertices].astype(np.float64), index[faces].astype(np.int32))


# The axes first, then the diagonals of the sides and of the cube.
_FIRST_DIRECTIONS = np.array(
    sorted(
        ([x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)),
        key=lambda direction: np.count_nonzero(direction),
    ),
    np.float64,
)
