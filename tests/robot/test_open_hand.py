"""The open hand as shapes, against the physics engine's own kinematics and known points."""

import mujoco
import numpy as np
import pytest

from bayesgrasp.robot.gripper_model import GripperHandle, add_gripper
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.robot.physics_scene import new_spec
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import generator
from bayesgrasp.types import GraspType

HAND = OpenHand(robotiq_3f())


@pytest.fixture(scope="module")
def physics():
    spec = new_spec()
    add_gripper(spec, spec.worldbody, HAND.gripper)
    model = spec.compile()
    data = mujoco.MjData(model)
    return model, data, GripperHandle(model, HAND.gripper)


@pytest.mark.parametrize("grasp_type", list(GraspType))
def test_shapes_stand_where_the_physics_engine_puts_them(physics, grasp_type) -> None:
    model, data, handle = physics
    handle.open(data, grasp_type)
    mujoco.mj_kinematics(model, data)
    names = [f"{link.name}_{k}" for link in HAND.gripper.links for k in range(len(link.shapes))]
    for name, placed in zip(names, HAND.shapes[grasp_type], strict=True):
        np.testing.assert_allclose(placed.shape_to_hand[:3, 3], data.geom(name).xpos, atol=1e-6)
        np.testing.assert_allclose(placed.shape_to_hand[:3, :3].ravel(), data.geom(name).xmat, atol=1e-6)


def distance(placed, points: np.ndarray) -> np.ndarray:
    """Signed distance from one shape, by the textbook's formula for its kind."""
    local = (points - placed.shape_to_hand[:3, 3]) @ placed.shape_to_hand[:3, :3]
    if placed.shape.kind == "box":
        q = np.abs(local) - placed.shape.size
        return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(1), 0)
    radius, half = placed.shape.size
    return np.linalg.norm(local - np.clip(local[:, 2:], -half, half) * [0, 0, 1], axis=1) - radius


@pytest.mark.parametrize("grasp_type", list(GraspType))
def test_distance_of_the_hand_is_that_of_its_nearest_shape(grasp_type) -> None:
    points = generator(0).uniform(-0.2, 0.3, (20_000, 3))
    expected = np.stack([distance(placed, points) for placed in HAND.shapes[grasp_type]]).min(0)
    assert (expected < 0).sum() > 100
    np.testing.assert_allclose(HAND.distance(points, grasp_type), expected, atol=1e-12)


def test_corners_cover_their_shape() -> None:
    for placed in HAND.shapes[GraspType.WIDE]:
        assert distance(placed, placed.corners()).min() > -1e-9


def test_closing_region_is_ahead_of_the_palm_between_the_fingers() -> None:
    depth = HAND.gripper.closing_depth
    points = np.array([[depth, 0.0, 0.0], [-0.05, 0.0, 0.0], [depth, 0.3, 0.0], [depth, 0.0, 0.2], [0.4, 0.0, 0.0]])
    assert HAND.between_fingers(points).tolist() == [True, False, False, False, False]


def test_lowest_point_of_a_hand_that_points_down() -> None:
    pose = np.array([[0, 1, 0, 0], [0, 0, -1, 0], [-1, 0, 0, 0.5], [0, 0, 0, 1]], dtype=float)
    reach = max(float(placed.corners()[:, 0].max()) for placed in HAND.shapes[GraspType.BASIC])
    assert HAND.lowest(pose, GraspType.BASIC) == pytest.approx(0.5 - reach)
