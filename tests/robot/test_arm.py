"""The arm's kinematics, each direction judged by the other and by an independent product of rotations."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.robot.arm import HOME, ArmDescription, ur5
from bayesgrasp.seeding import generator

ARM = ur5()


def screw_product(arm: ArmDescription, q: np.ndarray) -> np.ndarray:
    """hand_to_world written with another library, one elementary motion after the other."""
    pose = RigidTransform.from_matrix(arm.base_to_world)
    for joint, angle in enumerate(q):
        pose = pose * RigidTransform.from_rotation(Rotation.from_euler("z", angle))
        pose = pose * RigidTransform.from_translation([0.0, 0.0, arm.d[joint]])
        pose = pose * RigidTransform.from_translation([arm.a[joint], 0.0, 0.0])
        pose = pose * RigidTransform.from_rotation(Rotation.from_euler("x", arm.alpha[joint]))
    return pose.as_matrix() @ arm.hand_to_flange


def random_angles(count: int, seed: int = 0) -> np.ndarray:
    return generator(seed).uniform(-1.0, 1.0, (count, 6)) * np.array(ARM.limits)


def hand_pose(position: tuple[float, float, float], approach_down: float = 0.0, yaw: float = 0.0) -> np.ndarray:
    """A hand that points down, turned by ``yaw`` and tilted by ``approach_down``."""
    down = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("zy", [yaw, approach_down]).as_matrix() @ down
    pose[:3, 3] = position
    return pose


def test_forward_kinematics_is_the_product_of_elementary_motions() -> None:
    angles = random_angles(50)
    poses = ARM.forward_kinematics(angles)
    expected = np.stack([screw_product(ARM, q) for q in angles])
    np.testing.assert_allclose(poses, expected, atol=1e-12)


@pytest.mark.parametrize("batch", [(), (1,), (2, 3), (0,)])
def test_forward_kinematics_takes_any_batch(batch: tuple[int, ...]) -> None:
    angles = generator(1).uniform(-1.0, 1.0, (*batch, 6))
    poses = ARM.forward_kinematics(angles)
    assert poses.shape == (*batch, 4, 4)
    for index in np.ndindex(batch):
        np.testing.assert_allclose(poses[index], screw_product(ARM, angles[index]), atol=1e-12)


def test_every_inverse_solution_reaches_the_pose_and_one_is_where_it_came_from() -> None:
    for q in random_angles(300, seed=2):
        pose = ARM.forward_kinematics(q)
        solutions = ARM.inverse_kinematics(pose, q)
        assert 1 <= len(solutions) <= 8
        np.testing.assert_allclose(
            ARM.forward_kinematics(solutions), np.broadcast_to(pose, (len(solutions), 4, 4)), atol=1e-9
        )
        np.testing.assert_allclose(solutions[0], q, atol=1e-6)


def test_solutions_are_nearest_to_the_reference_within_the_limits() -> None:
    reference = np.array(HOME)
    limits = np.array(ARM.limits)
    for q in random_angles(200, seed=3):
        solutions = ARM.inverse_kinematics(ARM.forward_kinematics(q), reference)
        assert (np.abs(solutions) <= limits).all()
        for turn in (-2 * math.pi, 2 * math.pi):
            nearer = np.abs(solutions + turn - reference) < np.abs(solutions - reference) - 1e-12
            assert not (nearer & (np.abs(solutions + turn) <= limits)).any()
        motion = np.abs(solutions - reference).max(axis=1)
        assert (np.diff(motion) >= 0).all()


def test_a_reference_at_the_limit_still_gives_angles_within_it() -> None:
    reference = np.array([6.2, -6.2, 3.1, 6.2, -6.2, 6.2])
    pose = ARM.forward_kinematics(np.array([-1.0, -1.2, 1.3, -1.4, -1.5, 1.0]))
    solutions = ARM.inverse_kinematics(pose, reference)
    assert len(solutions) == len(ARM.inverse_kinematics(pose))
    assert (np.abs(solutions) <= np.array(ARM.limits)).all()
    np.testing.assert_allclose(ARM.forward_kinematics(solutions) - pose, 0.0, atol=1e-9)


def test_rotations_rounded_to_float32_lose_no_solution(capfd: pytest.CaptureFixture[str]) -> None:
    for q in random_angles(100, seed=4):
        pose = ARM.forward_kinematics(q)
        rounded = pose.astype(np.float32).astype(np.float64)
        solutions = ARM.inverse_kinematics(rounded)
        assert len(solutions) == len(ARM.inverse_kinematics(pose)) > 0
        np.testing.assert_allclose(ARM.forward_kinematics(solutions) - rounded, 0.0, atol=1e-6)
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize(
    "pose",
    [hand_pose((3.0, 0.0, 0.2)), hand_pose((-0.45, 0.0, 0.2)), np.full((4, 4), np.nan), np.full((4, 4), np.inf)],
    ids=["too far", "inside the base", "not a number", "infinite"],
)
def test_a_pose_without_solutions_gives_none(pose: np.ndarray) -> None:
    assert ARM.inverse_kinematics(pose).shape == (0, 6)


@pytest.mark.parametrize(
    "q", [np.zeros(6), np.array([0.0, -1.0, 1.0, -1.0, 0.0, 0.2]), np.array([0, -np.pi / 2, 0, -np.pi / 2, 0, 0])]
)
def test_singular_configurations_give_true_solutions_or_none(q: np.ndarray) -> None:
    pose = ARM.forward_kinematics(q)
    solutions = ARM.inverse_kinematics(pose)
    assert np.isfinite(solutions).all()
    np.testing.assert_allclose(
        ARM.forward_kinematics(solutions), np.broadcast_to(pose, (len(solutions), 4, 4)), atol=1e-9
    )


def test_the_base_pose_moves_every_hand_with_it() -> None:
    moved = ur5((0.2, -0.3, 0.4), base_yaw=0.7)
    q = np.array(HOME)
    there = moved.base_to_world @ np.linalg.inv(ARM.base_to_world) @ ARM.forward_kinematics(q)
    np.testing.assert_allclose(moved.forward_kinematics(q), there, atol=1e-12)
    np.testing.assert_allclose(moved.inverse_kinematics(there)[0], q, atol=1e-9)


def test_the_workspace_is_in_reach_at_the_grasp_behind_it_and_above_it() -> None:
    """Hands over the whole box of the prior, tilted by up to 45 degrees (BASE_POSITION has the prior itself)."""
    rng = generator(5)
    reached = 0
    for _ in range(300):
        position = tuple(rng.uniform((-0.15, -0.15, 0.12), (0.15, 0.15, 0.34)).tolist())
        pose = hand_pose(position, rng.uniform(0.0, math.pi / 4), rng.uniform(-math.pi, math.pi))
        behind, above = pose.copy(), pose.copy()
        behind[:3, 3] -= 0.10 * pose[:3, 0]
        above[2, 3] += 0.20
        reached += all(len(ARM.inverse_kinematics(p)) for p in (pose, behind, above))
    assert reached >= 298


def test_home_holds_the_hand_above_the_workspace_pointing_down() -> None:
    pose = ARM.forward_kinematics(np.array(HOME))
    np.testing.assert_allclose(pose[:3, 0], [0.0, 0.0, -1.0], atol=1e-9)
    assert pose[2, 3] > 0.5
    assert -0.25 < pose[0, 3] < 0.0
    assert abs(pose[1, 3]) < 0.05


@pytest.mark.parametrize("field", ["limits", "speed", "torque", "mass"])
def test_nonsense_is_refused(field: str) -> None:
    with pytest.raises(InvalidConfigurationError, match=field):
        dataclasses.replace(ARM, **{field: (1.0, 1.0, 1.0, 1.0, 1.0, -1.0)})


def test_a_home_outside_the_limits_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="home"):
        dataclasses.replace(ARM, home=(0.0, 0.0, 3.5, 0.0, 0.0, 0.0))
