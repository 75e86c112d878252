"""The open hand against the measured surface: does it cut through it, and is anything between the fingers?

The open hand of a grasp type is a set of boxes and capsules fixed in the hand frame (forward kinematics of the
gripper's description at its pre-shape), all of them rounded boxes (`clearance_kernels`). The closing region is the box
between the fingers: from the palm to the fingertips, as wide as the middles of the fingers are apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Float64
from scipy.spatial.transform import Rotation

from bayesgrasp.robot.clearance_kernels import least_distance
from bayesgrasp.robot.gripper import GripperDescription, Link, Shape
from bayesgrasp.types import GraspType

Points = Float64[np.ndarray, "n 3"]
CoveringBoxes = tuple[Float64[np.ndarray, "shapes 3"], Float64[np.ndarray, "shapes 3 3"]]
"""Centres of boxes, and their half axes as rows, hand frame, metres."""


@dataclass(frozen=True)
class Placed:
    """A shape of the open hand.

    Attributes:
        shape: Box or capsule, and its size in metres.
        shape_to_hand: Pose of its own frame in the hand frame.
    """

    shape: Shape
    shape_to_hand: Float64[np.ndarray, "4 4"]

    @property
    def rounded_box(self) -> tuple[Float64[np.ndarray, "3"], float]:
        """Half extents and radius, metres; see `clearance_kernels`."""
        size = np.array(self.shape.size)
        return (size, 0.0) if self.shape.kind == "box" else (np.array([0.0, 0.0, size[1]]), float(size[0]))

    def half_axes(self) -> Float64[np.ndarray, "3 3"]:
        """From the middle of a box around the shape to its faces, one row each, hand frame, metres."""
        extents, radius = self.rounded_box
        axes: Float64[np.ndarray, "3 3"] = (extents + radius)[:, None] * self.shape_to_hand[:3, :3].T
        return axes

    def corners(self) -> Float64[np.ndarray, "8 3"]:
        """Corners of a box around the shape, hand frame, metres."""
        extents, radius = self.rounded_box
        half = extents + radius
        signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
        corners: Float64[np.ndarray, "8 3"] = signs * half @ self.shape_to_hand[:3, :3].T + self.shape_to_hand[:3, 3]
        return corners


class OpenHand:
    """Shapes of a gripper's open hand by grasp type.

    Args:
        gripper: The gripper.
    """

    def __init__(self, gripper: GripperDescription) -> None:
        self.gripper = gripper

    @cached_property
    def shapes(self) -> dict[GraspType, tuple[Placed, ...]]:
        """All shapes at the pre-shape of each grasp type."""
        return {t: tuple(self._place(t)) for t in GraspType}

    def distance(self, points: Points, grasp_type: GraspType) -> Float64[np.ndarray, "n"]:
        """Signed distance (metres, negative inside) of points in the hand frame from the open hand."""
        distances = np.empty(len(points))
        least_distance(points, *self._packed[grasp_type], distances)
        return distances

    def lowest(self, hand_to_world: Float[np.ndarray, "4 4"], grasp_type: GraspType) -> float:
        """Height of the lowest point of the open hand's covering boxes above the table, metres."""
        return float((self._corners[grasp_type] @ hand_to_world[2, :3]).min() + hand_to_world[2, 3])

    def between_fingers(self, points: Points) -> np.ndarray:
        """Which points (hand frame, metres) are in the closing region."""
        reach, across, beside = self._closing_region
        x, y, z = points.T
        between: np.ndarray = (x > 0) & (x < reach) & (np.abs(y) < across) & (np.abs(z) < beside)
        return between

    @cached_property
    def covering_boxes(self) -> dict[GraspType, CoveringBoxes]:
        """Boxes around all shapes, by grasp type."""
        return {
            t: (np.stack([p.shape_to_hand[:3, 3] for p in shapes]), np.stack([p.half_axes() for p in shapes]))
            for t, shapes in self.shapes.items()
        }

    @cached_property
    def _corners(self) -> dict[GraspType, Points]:
        """Corners of all covering boxes, hand frame, metres."""
        return {t: np.concatenate([placed.corners() for placed in shapes]) for t, shapes in self.shapes.items()}

    @cached_property
    def _packed(self) -> dict[GraspType, tuple[np.ndarray, ...]]:
        """The shapes as `least_distance` takes them."""
        return {t: _pack(shapes) for t, shapes in self.shapes.items()}

    @cached_property
    def _closing_region(self) -> tuple[float, float, float]:
        """Reach of the fingertips ahead of the palm, and half widths across the fingers and beside them, metres."""
        middles = np.stack([placed.shape_to_hand[:3, 3] for placed in self.shapes[GraspType.BASIC]])
        corners = self._corners[GraspType.BASIC]
        ahead = middles[:, 0] > 0.5 * self.gripper.closing_depth
        across, beside = np.abs(middles[ahead, 1:]).max(0)
        return float(corners[:, 0].max()), float(across), float(beside)

    def _place(self, grasp_type: GraspType) -> list[Placed]:
        angles = dict(zip(self.gripper.joint_names, self.gripper.open_angles(grasp_type), strict=True))
        poses: dict[str | None, np.ndarray] = {None: np.eye(4)}
        placed = []
        for link in self.gripper.links:
            poses[link.name] = poses[link.parent] @ _link_pose(link, angles)
            placed += [Placed(s, poses[link.name] @ _pose(s.position, s.quaternion)) for s in link.shapes]
        return placed


def _pack(shapes: tuple[Placed, ...]) -> tuple[np.ndarray, ...]:
    """Centres, rotations, half extents, radii and bounding radii of shapes."""
    poses = np.stack([placed.shape_to_hand for placed in shapes])
    extents, radii = (np.array(column) for column in zip(*(placed.rounded_box for placed in shapes), strict=True))
    bounds = np.linalg.norm(extents, axis=1) + radii
    return np.ascontiguousarray(poses[:, :3, 3]), np.ascontiguousarray(poses[:, :3, :3]), extents, radii, bounds


def _link_pose(link: Link, angles: dict[str, float]) -> np.ndarray:
    pose = _pose(link.position, link.quaternion)
    if link.joint is not None:
        axis = np.array(link.joint.axis) / np.linalg.norm(link.joint.axis)
        if link.joint.kind == "slide":
            pose[:3, 3] += pose[:3, :3] @ axis * angles[link.joint.name]
            return pose
        pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(angles[link.joint.name] * axis).as_matrix()
    return pose


def _pose(position: tuple[float, ...], quaternion: tuple[float, ...]) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(np.array(quaternion), scalar_first=True).as_matrix()
    pose[:3, 3] = position
    return pose
