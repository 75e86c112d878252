r"""The arm as data, and its kinematics: a UR5 (CB3) that stands on the table behind the workspace.

Denavit-Hartenberg convention: link i is reached from link i-1 by

    T_i(q_i) = R_z(q_i) T_z(d_i) T_x(a_i) R_x(alpha_i),     flange_to_base(q) = T_1(q_1) ... T_6(q_6),

with the z axis of the last frame, the tool axis, along the hand's approach axis. The inverse is closed-form, all
branches at once (`ur_analytic_ik`). Every pose here is a homogeneous 4x4 matrix in metres, float64; joint angles are
radians. The arm's physics is `bayesgrasp.robot.arm_model`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64
from ur_analytic_ik import ur5 as closed_form

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.robot.branch_kernels import nearest_turns

JOINTS = 6
Six = tuple[float, float, float, float, float, float]
Solver = Callable[[Float64[np.ndarray, "4 4"]], Sequence[Float64[np.ndarray, "6"]]]

# Unconfirmed: from the flange to the palm's origin; the palm's housing ends 78 mm behind that origin.
PALM_DISTANCE = 0.0945
# On a pedestal behind the workspace: of 2,000 hands of the prior 99.3 % are reached from 0.10 m behind, and lifted by
# 0.15 m, without collision of the arm; without the pedestal 97.9 %, 5 cm nearer 98.7 %, 5 cm farther 98.5 %
# (python benchmarks/arm_reach.py --hands 2000).
BASE_POSITION = (-0.45, 0.0, 0.10)
BASE_YAW = math.pi  # at joint angle zero a UR arm stretches along its base's -x
HOME: Six = (-0.37, -2.0, 1.6, 0.4 - math.pi / 2, -math.pi / 2, -0.37)


@dataclass(frozen=True)
class Capsule:
    """A capsule between two points of a body's frame, metres."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float

    @property
    def volume(self) -> float:
        """Cubic metres."""
        return math.pi * self.radius**2 * (math.dist(self.start, self.end) + 4 / 3 * self.radius)


@dataclass(frozen=True)
class ArmDescription:
    """A six-joint arm, where it stands, and how the hand is bolted to it.

    Attributes:
        name: Identity.
        d: Offsets along the joint axes, metres.
        a: Lengths along the common normals, metres.
        alpha: Twists, radians.
        limits: Largest |angle| of each joint, radians.
        speed: Largest |velocity| of each joint, rad/s.
        torque: Largest |torque| of each joint, N m.
        mass: Of the six moving links, kg.
        shapes: Of the six moving links: capsules in the frame that stands at the end of the link before and turns
            with the joint (about z).
        base_position: Origin of the base frame in the world frame, metres.
        base_yaw: Angle of the base frame about the world's z axis, radians.
        palm_distance: From the flange to the palm's origin along the tool axis, metres.
        home: Joint angles that keep arm and hand above the workspace and out of the camera's sight.
        solver: All joint angles that bring the flange to a pose in the base frame.
    """

    name: str
    d: Six
    a: Six
    alpha: Six
    limits: Six
    speed: Six
    torque: Six
    mass: Six
    shapes: tuple[tuple[Capsule, ...], ...]
    base_position: tuple[float, float, float]
    base_yaw: float
    palm_distance: float
    home: Six
    solver: Solver

    def __post_init__(self) -> None:
        for field in ("limits", "speed", "torque", "mass"):
            if not all(math.isfinite(value) and value > 0 for value in getattr(self, field)):
                raise InvalidConfigurationError(
                    f"arm {self.name}: {field} needs positive numbers, got {getattr(self, field)}"
                )
        if len(self.shapes) != JOINTS:
            raise InvalidConfigurationError(f"arm {self.name}: shapes of {JOINTS} links needed, got {len(self.shapes)}")
        if any(abs(q) > limit for q, limit in zip(self.home, self.limits, strict=True)):
            raise InvalidConfigurationError(f"arm {self.name}: home {self.home} is outside the limits {self.limits}")

    @cached_property
    def base_to_world(self) -> Float64[np.ndarray, "4 4"]:
        """Pose of the base frame in the world frame."""
        pose = _rotation_z(np.float64(self.base_yaw))
        pose[:3, 3] = self.base_position
        return pose

    @cached_property
    def hand_to_flange(self) -> Float64[np.ndarray, "4 4"]:
        """Pose of the hand frame in the flange frame: hand x is the flange's z, hand y its x, hand z its y."""
        pose = np.array([[0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
        pose[2, 3] = self.palm_distance
        return pose

    @cached_property
    def fixed_transforms(self) -> Float64[np.ndarray, "6 4 4"]:
        """T_z(d_i) T_x(a_i) R_x(alpha_i), the part of each link's transform that its joint does not move."""
        fixed = np.zeros((JOINTS, 4, 4))
        cos, sin = np.cos(self.alpha), np.sin(self.alpha)
        fixed[:, 0, 0] = fixed[:, 3, 3] = 1.0
        fixed[:, 1, 1] = fixed[:, 2, 2] = cos
        fixed[:, 1, 2], fixed[:, 2, 1] = -sin, sin
        fixed[:, 0, 3], fixed[:, 2, 3] = self.a, self.d
        return fixed

    def forward_kinematics(self, q: Float64[np.ndarray, "*batch 6"]) -> Float64[np.ndarray, "*batch 4 4"]:
        """hand_to_world at joint angles ``q``."""
        links = _rotation_z(q) @ self.fixed_transforms
        pose = self.base_to_world
        for joint in range(JOINTS):
            pose = pose @ links[..., joint, :, :]
        hand_to_world: Float64[np.ndarray, "*batch 4 4"] = pose @ self.hand_to_flange
        return hand_to_world

    def inverse_kinematics(
        self, hand_to_world: Float64[np.ndarray, "4 4"], reference: Float64[np.ndarray, "6"] | None = None
    ) -> Float64[np.ndarray, "solutions 6"]:
        """All joint angles that bring the hand to a pose, nearest to the reference first (largest joint motion).

        Of the angles that differ by full turns, the one nearest to the reference and within the limits is taken.

        Args:
            hand_to_world: The hand's pose; its rotation may carry float32's rounding. One that is not finite has no
                solutions.
            reference: Joint angles to stay near; by default `home`.

        Returns:
            One row per branch, at most eight; none where the pose is out of reach or exactly singular.
        """
        near = self._home if reference is None else reference
        if not np.isfinite(hand_to_world).all():
            return np.zeros((0, JOINTS))
        branches = self.solver(self._world_to_base @ _orthonormalized(hand_to_world) @ self._flange_to_hand)
        if len(branches) == 0:
            return np.zeros((0, JOINTS))
        nearest_first: Float64[np.ndarray, "solutions 6"] = nearest_turns(np.asarray(branches), near, self._limits)
        return nearest_first

    @cached_property
    def _home(self) -> Float64[np.ndarray, "6"]:
        return np.array(self.home)

    @cached_property
    def _limits(self) -> Float64[np.ndarray, "6"]:
        return np.array(self.limits)

    @cached_property
    def _world_to_base(self) -> Float64[np.ndarray, "4 4"]:
        return np.linalg.inv(self.base_to_world)

    @cached_property
    def _flange_to_hand(self) -> Float64[np.ndarray, "4 4"]:
        return np.linalg.inv(self.hand_to_flange)


# Unconfirmed: tubes and joint housings by eye, a little short where neighbours but one fold past each other.
_SHAPES: tuple[tuple[Capsule, ...], ...] = (
    (Capsule((0.0, 0.0, 0.0892), (0.0, -0.065, 0.0892), 0.058),),
    (
        Capsule((0.0, 0.0, 0.1359), (-0.425, 0.0, 0.1359), 0.053),
        Capsule((-0.425, 0.0, 0.07), (-0.425, 0.0, 0.1359), 0.053),
    ),
    (
        Capsule((0.0, 0.0, 0.0162), (-0.3922, 0.0, 0.0162), 0.045),
        Capsule((-0.3922, 0.0, 0.0162), (-0.3922, 0.0, 0.035), 0.040),
    ),
    (
        Capsule((0.0, 0.0, 0.055), (0.0, 0.0, 0.1092), 0.040),
        Capsule((0.0, 0.0, 0.1092), (0.0, -0.02, 0.1092), 0.038),
    ),
    (
        Capsule((0.0, 0.0, 0.05), (0.0, 0.0, 0.0947), 0.040),
        Capsule((0.0, 0.0, 0.0947), (0.0, 0.02, 0.0947), 0.038),
    ),
    (Capsule((0.0, 0.0, 0.04), (0.0, 0.0, 0.05), 0.035),),
)


def ur5(base_position: tuple[float, float, float] = BASE_POSITION, base_yaw: float = BASE_YAW) -> ArmDescription:
    """The paper's arm: Universal Robots UR5, CB3 series, nominal (not factory-calibrated) kinematics.

    Args:
        base_position: Where it stands, metres in the world frame; the default maximises reach over the hand prior.
        base_yaw: Its heading, radians; all joints turn fully, so the reach does not depend on it.
    """
    turn, quarter = 2 * math.pi, math.pi / 2
    return ArmDescription(
        name="ur5",
        d=(0.089159, 0.0, 0.0, 0.10915, 0.09465, 0.0823),
        a=(0.0, -0.425, -0.39225, 0.0, 0.0, 0.0),
        alpha=(quarter, 0.0, 0.0, quarter, -quarter, 0.0),
        limits=(turn, turn, math.pi, turn, turn, turn),
        speed=(math.pi, math.pi, math.pi, math.pi, math.pi, math.pi),
        torque=(150.0, 150.0, 150.0, 28.0, 28.0, 28.0),
        mass=(3.7, 8.393, 2.275, 1.219, 1.219, 0.1879),
        shapes=_SHAPES,
        base_position=base_position,
        base_yaw=base_yaw,
        palm_distance=PALM_DISTANCE,
        home=HOME,
        solver=closed_form.inverse_kinematics,
    )


def _rotation_z(angle: Float64[np.ndarray, "*batch"] | np.float64) -> Float64[np.ndarray, "*batch 4 4"]:
    """Homogeneous rotation about z."""
    cos, sin = np.cos(angle), np.sin(angle)
    pose = np.zeros((*np.shape(angle), 4, 4))
    pose[..., 0, 0] = pose[..., 1, 1] = cos
    pose[..., 0, 1], pose[..., 1, 0] = -sin, sin
    pose[..., 2, 2] = pose[..., 3, 3] = 1.0
    return pose


def _orthonormalized(pose: Float64[np.ndarray, "4 4"]) -> Float64[np.ndarray, "4 4"]:
    """The pose with its axes made orthonormal to float64; the solver takes rounded ones for out of reach.

    Gram and Schmidt in plain numbers: on vectors of three, several times faster than array calls.
    """
    (x0, y0, _, p0), (x1, y1, _, p1), (x2, y2, _, p2), _ = pose.tolist()
    length = math.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
    x0, x1, x2 = x0 / length, x1 / length, x2 / length
    along = x0 * y0 + x1 * y1 + x2 * y2
    y0, y1, y2 = y0 - along * x0, y1 - along * x1, y2 - along * x2
    length = math.sqrt(y0 * y0 + y1 * y1 + y2 * y2)
    y0, y1, y2 = y0 / length, y1 / length, y2 / length
    z0, z1, z2 = x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0
    return np.array(((x0, y0, z0, p0), (x1, y1, z1, p1), (x2, y2, z2, p2), (0.0, 0.0, 0.0, 1.0)))
