"""The hand alone: where its shapes are at any joint angles, how it closes on nothing, and all that it can touch.

What a closing hand can touch is a union of convex regions, one for each link and each third of the travel of its
finger's first joint: the convex hull of the link's shapes over the joint angles that stops and couplings allow, grown
by `MARGIN` and drawn back along the approach. The angles are a grid, and shapes between its nodes are taken to be
within hull and margin; the tests check this along the closing motion, `benchmarks/screening.py` on outcomes.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise, product

import mujoco
import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.separation import Halfspaces
from bayesgrasp.lift.free_closing import MARGIN, FreeClosing
from bayesgrasp.robot.gripper import GripperDescription, Shape
from bayesgrasp.robot.gripper_model import GripperHandle, HandState, add_gripper
from bayesgrasp.robot.physics_scene import TABLE_GEOM, PhysicsConfig, new_spec
from bayesgrasp.types import GraspType

Points = Float64[np.ndarray, "_ 3"]
JointPath = Float64[np.ndarray, "_ joints"]

CLEARANCE = 0.0095
"""Metres that the hand keeps from everything at samples of its motion, to be sure of `MARGIN` between them, too."""

# A point that moves by s between two samples is within s / 2 of where it is at one of them.
SAMPLE_SPACING = 2.0 * (CLEARANCE - MARGIN)

_FIRST_STEPS, _OTHER_STEPS = 9, 4
"""Angles of a finger's first joint in the grid, and of its others."""
_MOST_OTHERS = 5
"""Joints beside the first: more make a grid of more than 10,000 nodes."""
_SECTORS = 3
"""Parts of the first joint's travel with a region of their own; one region for all of it would be mostly air."""
_YIELD = math.radians(1.0)
"""By which joints that a servo holds give way under a grasp."""
_SLACK = 0.25
"""Radians by which nodes of the grid may miss a coupling's stops; without it no node is near a stop between nodes."""


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

    def __init__(self, gripper: GripperDescription, physics: PhysicsConfig | None = None) -> None:
        self.gripper = gripper
        spec = new_spec(physics or PhysicsConfig())
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

    def record_closing(
        self, grasp_type: GraspType, period: float, limit: int | None = None, rest: int = 0
    ) -> FreeClosing:
        """The hand closing on nothing, controlled every ``period`` seconds, until no motor moves.

        Args:
            grasp_type: Pre-shape.
            period: Of the control, seconds.
            limit: Ticks after which it ends even if a motor still moves.
            rest: Ticks to go on after it, with motors as they then are.
        """
        data, advancing = self.data, True
        mujoco.mj_resetData(self.model, data)
        self.hand.open(data, grasp_type)
        states = [self.hand.state(data)]
        while advancing and (limit is None or len(states) <= limit):
            advancing = self._close(grasp_type, period)
            states.append(self.hand.state(data))
        for _ in range(rest):
            self._close(grasp_type, period)
            states.append(self.hand.state(data))
        clouds = [self._cloud(state.angles) for state in states]
        steps = [np.linalg.norm(after - before, axis=1).max() for before, after in pairwise(clouds)]
        return FreeClosing(HandState.stack(states), np.cumsum([0.0, *steps]))

    def free_closing(self, grasp_type: GraspType, period: float) -> JointPath:
        """Joint angles (radians) of the hand closing on nothing, controlled every ``period`` seconds.

        No point of the hand moves farther than `SAMPLE_SPACING` between samples.
        """
        closing = self.record_closing(grasp_type, period)
        angles = closing.angles[:-1]  # in the last period no motor moved
        path, last = [angles[0]], self._cloud(angles[0])
        for now in angles[1:]:
            cloud = self._cloud(now)
            # Not the whole spacing: one more period of closing would pass it.
            if np.linalg.norm(cloud - last, axis=1).max() > 0.75 * SAMPLE_SPACING:
                path, last = [*path, now], cloud
        return np.stack([*path, angles[-1]])

    def _close(self, grasp_type: GraspType, period: float) -> bool:
        """Close for one period of the control; whether a motor moved."""
        advancing = self.hand.close(self.data, grasp_type, period)
        mujoco.mj_step(self.model, self.data, round(period / self.model.opt.timestep))
        return advancing

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
        """All fingers at once through a grid of the joint angles that couplings allow, with the sector of each node."""
        others = max(map(len, self._fingers)) - 1
        if others > _MOST_OTHERS:
            raise InvalidConfigurationError(
                f"gripper {self.gripper.name}: a motor and its couplings move {others + 1} joints; at most "
                f"{_MOST_OTHERS + 1} can be screened"
            )
        grid = product(np.linspace(0.0, 1.0, _FIRST_STEPS), *[np.linspace(0.0, 1.0, _OTHER_STEPS)] * others)
        nodes = [(self._pose(grasp_type, node, held), node[0]) for node in grid for held in (-_YIELD, _YIELD)]
        # A little less than the number of sectors: the end of the travel belongs to the last one.
        return [(pose, int((_SECTORS - 0.001) * first)) for pose, first in nodes if self._allowed(pose)]

    def _pose(self, grasp_type: GraspType, fractions: tuple[float, ...], held: float) -> Float64[np.ndarray, "joints"]:
        """Angles with each joint of every finger at a fraction of its range, and held joints off by ``held``."""
        gripper = self.gripper
        index = gripper.joint_names.index
        ranges = {link.joint.name: link.joint.range for link in gripper.links if link.joint}
        pose = gripper.open_angles(grasp_type)
        for joints in self._fingers:
            for name, fraction in zip(joints, fractions, strict=False):  # the longest finger has one for each joint
                low, high = ranges[name]
                pose[index(name)] = low + fraction * (high - low)
        for name in gripper.holders:
            pose[index(name)] += held
        return pose

    @cached_property
    def _fingers(self) -> list[list[str]]:
        """Names of the joints of each motor: those that it pulls, then those that couplings alone tie to them."""
        fingers, pulled = [], {name for motor in self.gripper.motors for name in motor.weights}
        for motor in self.gripper.motors:
            joints = dict.fromkeys(motor.weights)
            for coupling in self.gripper.couplings:
                if joints.keys() & coupling.weights.keys():
                    joints |= dict.fromkeys(name for name in coupling.weights if name not in pulled)
            fingers.append(list(joints))
        return fingers

    def _allowed(self, angles: Float64[np.ndarray, "joints"]) -> bool:
        """Whether the couplings' stops allow these angles."""
        index = self.gripper.joint_names.index
        lengths = [(sum(w * angles[index(n)] for n, w in c.weights.items()), c.range) for c in self.gripper.couplings]
        return all(low - _SLACK <= length <= high + _SLACK for length, (low, high) in lengths)


def _inflate(points: Points, radius: float) -> Points:
    """Corners of cubes around points: they contain the balls of that radius."""
    corners = radius * np.array(list(product((-1.0, 1.0), repeat=3)))
    return (points[:, None, :] + corners).reshape(-1, 3)


def _hull(points: Points) -> Halfspaces:
    # Triangles of one face have one plane: rounded, they become one row.
    equations = np.unique(ConvexHull(points).equations.round(9), axis=0)
    return Halfspaces(np.ascontiguousarray(equations[:, :3]), -equations[:, 3])
