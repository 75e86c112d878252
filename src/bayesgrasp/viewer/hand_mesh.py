"""The open hand as triangles, for pictures that a browser draws."""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Float32, UInt32

from bayesgrasp.robot.open_hand import OpenHand, Placed
from bayesgrasp.types import GraspType

Triangles = tuple[Float32[np.ndarray, "v 3"], UInt32[np.ndarray, "f 3"]]
"""Vertices, metres, and the three vertices of each face."""
TYPE_COLORS = {GraspType.BASIC: (214, 69, 65), GraspType.WIDE: (46, 160, 67), GraspType.PINCH: (52, 120, 212)}
"""Red, green, blue, as in the sheets of data sets."""


def open_hand_mesh(hand: OpenHand, grasp_type: GraspType) -> Triangles:
    """All shapes of the open hand at the pre-shape of a grasp type, hand frame."""
    vertices, faces, count = [], [], 0
    for corners, triangles in map(_solid, hand.shapes[grasp_type]):
        vertices.append(corners)
        faces.append(triangles + count)
        count += len(corners)
    return np.concatenate(vertices).astype(np.float32), np.concatenate(faces).astype(np.uint32)


def _solid(placed: Placed) -> tuple[np.ndarray, np.ndarray]:
    size = np.array(placed.shape.size)
    if placed.shape.kind == "box":
        solid = trimesh.creation.box(extents=2 * size)
    else:
        solid = trimesh.creation.capsule(height=2 * size[1], radius=size[0], count=(8, 8))
        # The middle of trimesh's capsule is at the origin in some releases only.
        solid.vertices[:, 2] -= 0.5 * (solid.vertices[:, 2].max() + solid.vertices[:, 2].min())
    pose = placed.shape_to_hand
    return np.asarray(solid.vertices) @ pose[:3, :3].T + pose[:3, 3], np.asarray(solid.faces)
