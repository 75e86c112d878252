"""From a hand configuration to a motion of the arm: pre-grasp, straight approach, lift.

The hand comes from a pre-grasp ``standoff`` metres behind h along the approach axis, moves straight to h, closes, and
rises straight up by ``lift_height`` (section 4.1: a planner brings the gripper to h; if the pose is not reachable, the
test fails). The arm's inverse kinematics is closed-form, so a straight line is followed on one branch of solutions:
a branch is usable if it exists at all waypoints and no joint jumps between them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.robot.arm import ArmDescription
from bayesgrasp.types import Attempts

DETOUR = 0.15
"""Metres above the pre-grasp of the point over which the arm goes where the straight way is blocked."""

Pose = Float64[np.ndarray, "4 4"]
Path = Float64[np.ndarray, "_ 6"]


@dataclass(frozen=True)
class MotionConfig:
    """Geometry of the motion.

    Attributes:
        standoff: Distance of the pre-grasp behind h along the approach axis, metres.
        lift_height: Rise of the hand after closing, metres.
        waypoints: Inverse-kinematics solutions along each straight line.
        largest_step: Largest joint motion between waypoints on one branch, radians.
        transit_step: Spacing of the collision checks from home to the pre-grasp, radians.
    """

    standoff: float = 0.10
    lift_height: float = 0.15
    waypoints: int = 5
    largest_step: float = 0.5
    transit_step: float = 0.20

    def __post_init__(self) -> None:
        if self.standoff <= 0 or self.lift_height <= 0:
            raise InvalidConfigurationError("standoff and lift_height must be positive, in metres")
        if self.waypoints < 2 or self.largest_step <= 0 or self.transit_step <= 0:
            raise InvalidConfigurationError("a line needs at least 2 waypoints; steps must be positive, in radians")


@dataclass(frozen=True)
class Motion:
    """Joint angles (radians) of a whole grasp.

    Attributes:
        transit: From home to the pre-grasp.
        approach: From the pre-grasp straight to h.
        lift: From h straight up.
    """

    transit: Path
    approach: Path
    lift: Path


def hand_pose(position: Float64[np.ndarray, "3"], quaternion: Float64[np.ndarray, "4"]) -> Pose:
    """hand_to_world of a position (metres) and a quaternion (w, x, y, z), which is normalised here."""
    w, x, y, z = quaternion / np.sqrt(quaternion @ quaternion)
    pose = np.eye(4)
    pose[:3, :3] = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    pose[:3, 3] = position
    return pose


def hand_poses(attempts: Attempts) -> Float64[np.ndarray, "n 4 4"]:
    """hand_to_world of each attempt, metres."""
    hands = zip(attempts.position.astype(np.float64), attempts.quaternion.astype(np.float64), strict=True)
    return np.array([hand_pose(position, quaternion) for position, quaternion in hands]).reshape(-1, 4, 4)


def approach_pose(hand_to_world: Pose, distance: float) -> Pose:
    """The hand ``distance`` metres behind a pose along its approach axis."""
    moved = hand_to_world.copy()
    moved[:3, 3] -= distance * hand_to_world[:3, 0]
    return moved


def lifted_pose(hand_to_world: Pose, height: float) -> Pose:
    """The hand ``height`` metres above a pose."""
    moved = hand_to_world.copy()
    moved[2, 3] += height
    return moved


def reachable_branches(arm: ArmDescription, hand_to_world: Pose, config: MotionConfig) -> list[Path]:
    """Branches of the inverse kinematics that exist at the pre-grasp, at h and at the lifted hand, nearest home first.

    Each is a (3, 6) array of joint angles at these three poses; an empty list means that the arm does not reach h.
    """
    grasp = arm.inverse_kinematics(hand_to_world)
    if len(grasp) == 0:
        return []
    before = arm.inverse_kinematics(approach_pose(hand_to_world, config.standoff))
    after = arm.inverse_kinematics(lifted_pose(hand_to_world, config.lift_height))
    if len(before) == 0 or len(after) == 0:
        return []
    # A branch of which no joint jumps between waypoints ends within so many of the largest steps from where it began.
    reach = config.largest_step * (config.waypoints - 1)
    steps = (_nearest(before, grasp, reach), _nearest(after, grasp, reach))
    return [np.stack([before[i], q, after[j]]) for q, i, j in zip(grasp, *steps, strict=True) if i >= 0 and j >= 0]


def reached(arm: ArmDescription, config: MotionConfig, attempts: Attempts) -> Bool[np.ndarray, "n"]:
    """Whether the arm reaches pre-grasp, h and lifted hand of each attempt on one branch, whatever is in its way."""
    return np.array([bool(reachable_branches(arm, pose, config)) for pose in hand_poses(attempts)], dtype=bool)


def _nearest(candidates: Path, references: Path, reach: float) -> list[int]:
    """For each reference the index of the nearest candidate, or -1 if none is within reach (largest joint motion)."""
    distance = np.abs(references[:, None, :] - candidates[None, :, :]).max(axis=-1)
    index = distance.argmin(axis=1)
    return [int(i) if distance[row, i] <= reach else -1 for row, i in enumerate(index)]


def straight_path(
    arm: ArmDescription, start: Pose, end: Pose, first: Float64[np.ndarray, "6"], config: MotionConfig
) -> Path | None:
    """Joint angles along the straight line between two hand poses of equal rotation, on the branch of ``first``."""
    path = [first]
    for fraction in np.linspace(0.0, 1.0, config.waypoints)[1:]:
        pose = start.copy()
        pose[:3, 3] += fraction * (end[:3, 3] - start[:3, 3])
        solutions = arm.inverse_kinematics(pose, reference=path[-1])
        if len(solutions) == 0 or np.abs(solutions[0] - path[-1]).max() > config.largest_step:
            return None
        path.append(solutions[0])
    return np.stack(path)


def plan_motion(
    arm: ArmDescription,
    hand_to_world: Pose,
    config: MotionConfig,
    collides: Callable[[Float64[np.ndarray, "6"]], bool],
) -> Motion | None:
    """The first collision-free motion to a hand pose, or None.

    Args:
        arm: The arm.
        hand_to_world: h, in metres.
        config: Geometry of the motion.
        collides: Whether the arm with the open hand collides at joint angles (radians).
    """
    before = approach_pose(hand_to_world, config.standoff)
    after = lifted_pose(hand_to_world, config.lift_height)
    for branch in reachable_branches(arm, hand_to_world, config):
        approach = straight_path(arm, before, hand_to_world, branch[0], config)
        lift = None if approach is None else straight_path(arm, hand_to_world, after, approach[-1], config)
        if approach is None or lift is None or any(map(collides, approach)):
            continue
        transit = _transit(arm, branch[0], config, collides)
        if transit is not None:
            return Motion(transit, approach, lift)
    return None


def _transit(
    arm: ArmDescription,
    goal: Float64[np.ndarray, "6"],
    config: MotionConfig,
    collides: Callable[[Float64[np.ndarray, "6"]], bool],
) -> Path | None:
    """A joint-space path from home: the straight one, else over a point above the pre-grasp."""
    home = np.array(arm.home)
    for via in _detours(arm, goal):
        corners = [home, *via, goal]
        legs = [_interpolate(a, b, config.transit_step) for a, b in pairwise(corners)]
        path = np.concatenate([home[None], *(leg[1:] for leg in legs)])
        # The far end is checked first: it is the likeliest to collide.
        if not any(collides(q) for q in path[::-1]):
            return path
    return None


def _detours(arm: ArmDescription, goal: Float64[np.ndarray, "6"]) -> Iterator[list[Float64[np.ndarray, "6"]]]:
    yield []
    above = lifted_pose(arm.forward_kinematics(goal), DETOUR)
    solutions = arm.inverse_kinematics(above, reference=goal)
    if len(solutions):
        yield [solutions[0]]


def _interpolate(start: Float64[np.ndarray, "6"], end: Float64[np.ndarray, "6"], step: float) -> Path:
    count = max(2, 1 + int(np.ceil(np.abs(end - start).max() / step)))
    path: Path = start + _fractions(count) * (end - start)
    return path


@lru_cache(maxsize=64)
def _fractions(count: int) -> Float64[np.ndarray, "count 1"]:
    return np.linspace(0.0, 1.0, count)[:, None]
