"""The resting pose: how an object stands or lies on the table, found by letting it settle.

The settling is quasi-static, as if infinitely damped. An object with centre of mass c that touches a plane rests on a
face of the convex hull of its parts; it stays there if the plumb line through c meets that face, and otherwise tips
over the edge that the line lies beyond. Each tip lowers c, so the walk ends. It starts at the face on which the object
stands as it was scanned, so a can stays upright; it needs no physics engine, no time step and no randomness, and ends
with the face exactly on the plane. A physics test of the catalogue confirms that objects stay where it puts them.

A scanner cannot see the underside of what it scans. What it fills in there is uneven, so that a box would rock on a
bump and a tall bottle topple where the real one stood. So the underside is flattened, by the least share of the height
that lets the object rest firmly as it was scanned; an object that none of `FLATTENING` makes firm settles as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull

from bayesgrasp.meshes.convex import ConvexPart, hull_part
from bayesgrasp.meshes.mass import mass_properties

FLATTENING = (0.0, 0.0025, 0.005, 0.01, 0.015, 0.02)  # shares of the height, tried in turn
AS_SCANNED = np.radians(0.2)  # an object that settles within this tilt rests as it was scanned
FIRM = np.radians(5.0)  # an object that withstands this tilt without touching with another face rests firmly
CONTACT = 1e-5  # metres; corners lower than this touch the plane


@dataclass(frozen=True)
class Resting:
    """How an object rests.

    Attributes:
        parts: Its convex parts in the frame of the mesh file, with the underside that it rests on.
        mesh_to_object: See `settle`.
        floor: Height in the frame of the file to which its underside was flattened, metres; -inf if it was not.
    """

    parts: tuple[ConvexPart, ...]
    mesh_to_object: Float64[np.ndarray, "4 4"]
    floor: float

    def place(self, points: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
        """Points of the mesh file in the object frame, the underside flattened as the parts' is."""
        raised = np.maximum(points, np.array([-np.inf, -np.inf, self.floor]))
        placed: Float64[np.ndarray, "n 3"] = raised @ self.mesh_to_object[:3, :3].T + self.mesh_to_object[:3, 3]
        return placed


def rest(parts: tuple[ConvexPart, ...]) -> Resting:
    """Settle an object, flattening its underside as little as lets it rest firmly as it was scanned."""
    heights = np.concatenate([part.vertices[:, 2] for part in parts])
    for share in FLATTENING:
        floor = float(heights.min() + share * np.ptp(heights)) if share else -np.inf
        flat = flatten(parts, floor) if share else parts
        pose = settle(flat, mass_properties(flat)[0])
        if pose[2, 2] >= np.cos(AS_SCANNED) and safe_tilt(flat, pose) >= FIRM:
            return Resting(flat, pose, floor)
    return Resting(parts, settle(parts, mass_properties(parts)[0]), -np.inf)


def flatten(parts: Sequence[ConvexPart], floor: float) -> tuple[ConvexPart, ...]:
    """Cut off what lies below the height ``floor``; parts that reach no higher vanish."""
    return tuple(_cut(part, floor) for part in parts if part.vertices[:, 2].max() > floor + CONTACT)


def _cut(part: ConvexPart, floor: float) -> ConvexPart:
    height = part.vertices[:, 2] - floor
    if height.min() >= 0:
        return part
    start, end = part.faces.reshape(-1), np.roll(part.faces, -1, axis=1).reshape(-1)
    crossing = (height[start] > 0) & (height[end] < 0)
    start, end = start[crossing], end[crossing]
    share = (height[start] / (height[start] - height[end]))[:, None]
    section = part.vertices[start] + share * (part.vertices[end] - part.vertices[start])
    section[:, 2] = floor
    return hull_part(np.concatenate([part.vertices[height > 0], section]))


def safe_tilt(parts: Sequence[ConvexPart], mesh_to_object: Float64[np.ndarray, "4 4"]) -> float:
    """The smallest tilt, radians, that brings the centre of mass of a resting object above an edge of its support."""
    points = np.concatenate([part.vertices for part in parts]) @ mesh_to_object[:3, :3].T + mesh_to_object[:3, 3]
    height = (mesh_to_object[:3, :3] @ mass_properties(parts)[0] + mesh_to_object[:3, 3])[2]
    support = ConvexHull(points[points[:, 2] < CONTACT][:, :2])
    return float(np.arctan2(-support.equations[:, 2].max(), height))


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
    rotation: Float64[np.ndarray, "3 3"] = np.eye(3) + hat + hat @ hat / (1 + cosine)
    return rotation
