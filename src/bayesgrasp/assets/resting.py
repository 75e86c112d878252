"""The resting pose: how an object stands or lies on the table, found by letting it settle.

The settling is quasi-static, as if infinitely damped. An object with centre of mass c that touches a plane rests on a
face of the convex hull of its parts; it stays there if the plumb line through c meets that face, and otherwise tips
over the edge that the line lies beyond. Each tip lowers c, so the walk ends. It starts at the face on which the object
stands as it was scanned, so a can stays upright; it needs no physics engine, no time step and no randomness, and ends
with the face exactly on the plane. A physics test of the catalogue confirms that objects stay where it puts them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull

from bayesgrasp.assets.convex import ConvexPart


def settle(parts: Sequence[ConvexPart], center_of_mass: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "4 4"]:
    """Settle an object that is let go with the z axis of its own frame upwards.

    Args:
        parts: Convex parts in the frame of the mesh file.
        center_of_mass: In the same frame, metres.

    Returns:
        mesh_to_object: the rotation without turn about the vertical, and the translation that brings the lowest point
        of the parts to z = 0 and the centre of mass above the origin.
    """
    points = np.concatenate([part.vertices for part in parts])
    up = -resting_normal(points, center_of_mass)
    mesh_to_object = np.eye(4)
    mesh_to_object[:3, :3] = rotation_between(up, np.array([0.0, 0.0, 1.0]))
    turned = points @ mesh_to_object[:3, :3].T
    center = mesh_to_object[:3, :3] @ center_of_mass
    mesh_to_object[:3, 3] = (-center[0], -center[1], -turned[:, 2].min())
    return mesh_to_object


def resting_normal(
    points: Float64[np.ndarray, "n 3"], center_of_mass: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "3"]:
    """Outward normal of the hull face on which the object comes to rest (see the module's docstring).

    Qhull's faces are triangles, several to a flat side; none is visited twice, so the walk ends there too.
    """
    hull = ConvexHull(points - center_of_mass)
    face, visited = _face_below(hull), set()
    while True:
        visited.add(face)
        beyond = _beyond_edges(hull, face)
        ways = [edge for edge in np.argsort(-beyond) if beyond[edge] > 0 and hull.neighbors[face, edge] not in visited]
        if not ways:
            normal: Float64[np.ndarray, "3"] = hull.equations[face, :3].copy()
            return normal
        face = int(hull.neighbors[face, ways[0]])


def _face_below(hull: ConvexHull) -> int:
    """The face that the plumb line through the origin meets."""
    down = -hull.equations[:, 2]
    distance = np.full(len(down), np.inf)
    np.divide(-hull.equations[:, 3], down, out=distance, where=down > 1e-12)
    return int(distance.argmin())


def _beyond_edges(hull: ConvexHull, face: int) -> Float64[np.ndarray, "3"]:
    """How far the foot of the perpendicular from the origin to a face lies beyond the edge opposite each corner."""
    foot = -hull.equations[face, 3] * hull.equations[face, :3]
    corners = hull.points[hull.simplices[face]]
    start, end = np.roll(corners, -1, axis=0), np.roll(corners, -2, axis=0)
    along = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
    outwards = np.cross(along, hull.equations[face, :3])
    outwards *= np.sign(np.einsum("ij,ij->i", outwards, start - corners))[:, None]
    beyond: Float64[np.ndarray, "3"] = np.einsum("ij,ij->i", foot - start, outwards)
    return beyond


def rotation_between(start: Float64[np.ndarray, "3"], end: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3 3"]:
    """The smallest rotation that takes the unit vector ``start`` to ``end``; half a turn about x or y if opposite."""
    cosine = float(start @ end)
    if cosine < -1 + 1e-12:
        axis = np.eye(3)[int(np.argmin(np.abs(end)))]
        axis -= (axis @ end) * end
        axis /= np.linalg.norm(axis)
        return 2 * np.outer(axis, axis) - np.eye(3)
    x, y, z = np.cross(start, end)
    hat = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + hat + hat @ hat / (1 + cosine)
