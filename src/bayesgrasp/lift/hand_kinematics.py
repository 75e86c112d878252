"""The hand alone: where its shapes are at any joint angles, how it closes on nothing, and all that it can touch.

What a closing hand can touch is a union of convex regions, one for each link and each third of the travel of its
finger's first joint: the convex hull of the link's shapes over the joint angles that stops and couplings allow, grown
by `MARGIN` and drawn back along the approach. The angles are a grid, and shapes between its nodes are taken to be
within hull and margin; the tests check this along the closing motion, `benchmarks/screening.py` on outcomes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull

from bayesgrasp.robot.gripper import GripperDescription, Shape
from bayesgrasp.robot.gripper_model import GripperHandle, add_gripper
from bayesgrasp.robot.physics_scene import TABLE_GEOM, new_spec
from bayesgrasp.types import GraspType

Points = Float64[np.ndarray, "_ 3"]
JointPath = Float64[np.ndarray, "_ joints"]

MARGIN = 0.003
"""Metres by which the reach of the hand is grown: contact softness, servo error, and the object's settling."""

CLEARANCE = 0.0095
"""Metres: `MARGIN` and half of the farthest that any point of the hand moves between samples of its motion."""

SAMPLE_SPACING = 2.0 * (CLEARANCE - MARGIN)
_STEPS = {"first": 9, "other": 4}


@dataclass(frozen=True)
class Halfspaces:
    """A convex region {p : normals p <= offsets} in the hand frame, metres."""

    normals: Float64[np.ndarray, "faces 3"]
    offsets: Float64[np.ndarray, "faces"]


def shape_points(shape: Shape) -> tuple[Points, float]:
    """Points of a shape in its link's frame and the radius around them (metres): together they cover it exactly."""
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, np.array(shape.quaternion))
    if shape.kind == "box":
        local, radius = np.array(list(product((-1.0, 1.0), repeat=3))) * shape.size, 0.0
    else:
        local, radius = np.array([[0.0, 0.0, -shape.size[1]], [0.0, 0.0, shape.size[1]]]), shape.size[0]
    return local @ rotation.reshape(3, 3).T + shape.position, radius


class HandKinematics:
    """Positions of a hand's shapes in the hand frame at any joint angles (one compiled model, no object)."""

    def __init__(self, gripper: GripperDescription) -> None:
        self.gripper = gripper
        spec = new_spec()
        spec.geom(TABLE_GEOM).contype = spec.geom(TABLE_GEOM).conaffinity = 0
        add_gripper(spec, spec.worldbody, gripper)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.hand = GripperHandle(self.model, gripper)

    def link_points(self, angles: Float64[np.ndarray, "joints"]) -> dict[str, list[tuple[Points, float]]]:
        """For each link its shapes' points in the hand frame with their radii (metres)."""
        self.data.qpos[self.hand.qpos] = angles
        mujoco.mj_kinematics(self.model, self.data)
        moved = {}
        for link in self.gripper.links:
            body = self.data.body(link.name)
            rotation, position = body.xmat.reshape(3, 3), body.xpos
            covers = [shape_points(shape) for shape in link.shapes]
            moved[link.name] = [(points @ rotation.T + position, radius) for points, radius in covers]
        return moved

    def open_points(self, grasp_type: GraspType) -> tuple[Points, Float64[np.ndarray, "points"]]:
        """Points and radii (metres) that cover the open hand of a grasp type."""
        shapes = [s for link in self.link_points(self.gripper.open_angles(grasp_type)).values() for s in link]
        points = np.concatenate([p for p, _ in shapes])
        return points, np.concatenate([np.full(len(p), radius) for p, radius in shapes])

    def free_closing(self, grasp_type: GraspType, period: float) -> JointPath:
        """Joint angles (radians) of the hand closing on nothing, controlled every ``period`` seconds.

        No point of the hand moves farther than `SAMPLE_SPACING` between samples.
        """
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        self.hand.open(data, grasp_type)
        path = [data.qpos[self.hand.qpos].copy()]
        last = cloud = self._cloud(path[0])
        while self.hand.close(data, grasp_type, period):
            mujoco.mj_step(model, data, round(period / model.opt.timestep))
            angles = data.qpos[self.hand.qpos].copy()
            cloud = self._cloud(angles)
            if np.linalg.norm(cloud - last, axis=1).max() > 0.75 * SAMPLE_SPACING:
                path, last = [*path, angles], cloud
        return np.stack([*path, data.qpos[self.hand.qpos].copy()])

    def _cloud(self, angles: Float64[np.ndarray, "joints"]) -> Points:
        return np.concatenate([points for shapes in self.link_points(angles).values() for points, _ in shapes])

    def touchable_regions(self, grasp_type: GraspType, drawback: float) -> list[Halfspaces]:
        """Convex regions that contain everything a closing hand can touch, also while it approaches.

        Args:
            grasp_type: Pre-shape; its held joints may yield by a degree.
            drawback: Length of the straight approach, metres.
        """
        clouds: dict[tuple[str, int], list[Points]] = {}
        for angles, sector in self._poses(grasp_type):
            for name, shapes in self.link_points(angles).items():
                key = (name, 0 if name == self.gripper.links[0].name else sector)
                clouds.setdefault(key, []).extend(_inflate(p, radius + MARGIN) for p, radius in shapes)
        back = np.array([drawback, 0.0, 0.0])
        return [_hull(np.concatenate([*cloud, *(p - back for p in cloud)])) for cloud in clouds.values()]

    def _poses(self, grasp_type: GraspType) -> list[tuple[Float64[np.ndarray, "joints"], int]]:
        """All fingers at once through a grid of the joint angles that stops and couplings allow."""
        gripper = self.gripper
        angles = gripper.open_angles(grasp_type)
        joints = {link.joint.name: link.joint for link in gripper.links if link.joint}
        fingers = [list(motor.weights) for motor in gripper.motors]
        poses = []
        for fractions in product(
            *(np.linspace(0.0, 1.0, _STEPS["first" if k == 0 else "other"]) for k in range(len(fingers[0])))
        ):
            for yielded in (-np.radians(1.0), np.radians(1.0)):
                pose = angles.copy()
                for finger in fingers:
                    for name, fraction in zip(finger, fractions, strict=True):
                        low, high = joints[name].range
                        pose[gripper.joint_names.index(name)] = low + fraction * (high - low)
                for name in gripper.holders:
                    pose[gripper.joint_names.index(name)] += yielded
                if self._allowed(pose):
                    poses.append((pose, int(2.999 * fractions[0])))
        return poses

    def _allowed(self, angles: Float64[np.ndarray, "joints"]) -> bool:
        """Whether the couplings' stops allow these angles, up to 0.25 rad (the grid's spacing)."""
        index = self.gripper.joint_names.index
        lengths = [(sum(w * angles[index(n)] for n, w in c.weights.items()), c.range) for c in self.gripper.couplings]
        return all(low - 0.25 <= length <= high + 0.25 for length, (low, high) in lengths)


def _inflate(points: Points, radius: float) -> Points:
    """Corners of cubes around points: they contain the balls of that radius."""
    corners = radius * np.array(list(product((-1.0, 1.0), repeat=3)))
    return (points[:, None, :] + corners).reshape(-1, 3)


def _hull(points: Points) -> Halfspaces:
    equations = np.unique(ConvexHull(points).equations.round(9), axis=0)
    return Halfspaces(np.ascontiguousarray(equations[:, :3]), -equations[:, 3])
