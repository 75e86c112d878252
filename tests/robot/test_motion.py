"""Motions of the arm: straight, continuous, on one branch, and refused where there is none."""

import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.robot.arm import ur5
from bayesgrasp.robot.motion import (
    MotionConfig,
    approach_pose,
    hand_pose,
    lifted_pose,
    plan_motion,
    reachable_branches,
    reached,
)
from bayesgrasp.types import Attempts

CONFIG = MotionConfig()


def pointing_down(positions: list[tuple[float, float, float]]) -> Attempts:
    n = len(positions)
    zeros = np.zeros(n, np.float32)
    return Attempts(
        position=np.array(positions, np.float32),
        quaternion=np.tile(np.array([1.0, 0.0, 1.0, 0.0], np.float32), (n, 1)),
        grasp_type=np.zeros(n, np.uint8),
        object_index=np.zeros(n, np.int32),
        object_pose=np.zeros((n, 3), np.float32),
        **dict.fromkeys(("scale", "lateral_friction", "spinning_friction", "mass_factor"), zeros),
    )


def _free(_: np.ndarray) -> bool:
    return False


def test_hand_pose_normalises_and_points_down() -> None:
    pose = hand_pose(np.array([0.1, 0.2, 0.3]), np.array([2.0, 0.0, 2.0, 0.0]))
    np.testing.assert_allclose(pose[:3, 0], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("position", [(0.0, 0.0, 0.2), (0.1, -0.1, 0.3), (-0.1, 0.12, 0.15)])
def test_the_approach_is_straight_and_ends_at_h(position: tuple[float, float, float]) -> None:
    arm, pose = ur5(), hand_pose(np.array(position), np.array([1.0, 0.0, 1.0, 0.0]))
    motion = plan_motion(arm, pose, CONFIG, _free)
    assert motion is not None
    reached = np.array([arm.forward_kinematics(q) for q in motion.approach])
    np.testing.assert_allclose(reached[-1], pose, atol=1e-6)
    np.testing.assert_allclose(reached[0], approach_pose(pose, CONFIG.standoff), atol=1e-6)
    np.testing.assert_allclose(reached[:, :3, :3], pose[:3, :3] + 0 * reached[:, :3, :3], atol=1e-6)
    # Straight: only the coordinate along the approach axis changes.
    local = (reached[:, :3, 3] - pose[:3, 3]) @ pose[:3, :3]
    np.testing.assert_allclose(local[:, 1:], 0.0, atol=1e-6)
    lifted = arm.forward_kinematics(motion.lift[-1])
    np.testing.assert_allclose(lifted, lifted_pose(pose, CONFIG.lift_height), atol=1e-6)


def test_the_motion_is_continuous_and_starts_at_home() -> None:
    arm, pose = ur5(), hand_pose(np.array([0.05, 0.05, 0.22]), np.array([1.0, 0.0, 1.0, 0.0]))
    motion = plan_motion(arm, pose, CONFIG, _free)
    assert motion is not None
    np.testing.assert_array_equal(motion.transit[0], arm.home)
    path = np.concatenate([motion.transit, motion.approach[1:], motion.lift[1:]])
    np.testing.assert_allclose(motion.transit[-1], motion.approach[0])
    assert np.abs(np.diff(path, axis=0)).max() <= CONFIG.largest_step


def test_out_of_reach_is_no_branch_and_no_motion() -> None:
    pose = hand_pose(np.array([2.0, 0.0, 0.2]), np.array([1.0, 0.0, 1.0, 0.0]))
    assert reachable_branches(ur5(), pose, CONFIG) == []
    assert plan_motion(ur5(), pose, CONFIG, _free) is None


def test_a_blocked_branch_gives_way_to_another() -> None:
    arm, pose = ur5(), hand_pose(np.array([0.0, 0.1, 0.25]), np.array([1.0, 0.0, 1.0, 0.0]))
    branches = reachable_branches(arm, pose, CONFIG)
    assert len(branches) >= 2
    first = branches[0][1]
    motion = plan_motion(arm, pose, CONFIG, lambda q: bool(np.abs(q - first).max() < 1e-3))
    assert motion is not None
    assert np.abs(motion.approach[-1] - first).max() > 0.1
    assert plan_motion(arm, pose, CONFIG, lambda q: True) is None


def test_reach_is_one_branch_at_pre_grasp_h_and_lifted_hand() -> None:
    """The far hand is reached itself, but not where the lift would end."""
    arm, hands = ur5(), pointing_down([(0.0, 0.0, 0.2), (2.0, 0.0, 0.2), (0.2, 0.0, 0.6)])
    poses = [hand_pose(x, np.array([1.0, 0.0, 1.0, 0.0])) for x in hands.position.astype(np.float64)]
    assert [len(arm.inverse_kinematics(pose)) > 0 for pose in poses] == [True, False, True]
    np.testing.assert_array_equal(reached(arm, CONFIG, hands), [True, False, False])
    assert reached(arm, CONFIG, hands[:0]).shape == (0,)


@pytest.mark.parametrize("wrong", [{"standoff": 0.0}, {"lift_height": -0.1}, {"waypoints": 1}, {"largest_step": 0.0}])
def test_wrong_motion_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidConfigurationError):
        MotionConfig(**wrong)
