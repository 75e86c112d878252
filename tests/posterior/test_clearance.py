"""The open hand as shapes, against the physics engine's own kinematics and known points."""

import mujoco
import numpy as np
import pytest

from bayesgrasp.assets.gripper_model import GripperHandle, add_gripper
from bayesgrasp.assets.robotiq_3f import robotiq_3f
from bayesgrasp.assets.scene import new_spec
from bayesgrasp.posterior.clearance import OpenHand
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


def test_sign_of_the_distance_is_that_of_being_inside() -> None:
    points = generator(0).uniform(-0.2, 0.3, (20_000, 3))
    for placed in HAND.shapes[GraspType.WIDE]:
        distance = placed.distance(points)
        local = (points - placed.shape_to_hand[:3, 3]) @ placed.shape_to_hand[:3, :3]
        if placed.shape.kind == "box":
            inside = (np.abs(local) < placed.shape.size).all(1)
        else:
            radius, half = placed.shape.size
            ball = np.linalg.norm(local - np.clip(local[:, 2:], -half, half) * [0, 0, 1], axis=1)
            inside = ball < radius
        assert ((distance < 0) == inside).all()
        assert placed.distance(placed.corners()).min() > -1e-9


def test_distance_of_the_hand_is_that_of_its_nearest_shape() -> None:
    points = generator(1).uniform(-0.3, 0.3, (100, 3))
    expected = np.stack([p.distance(points) for p in HAND.shapes[GraspType.BASIC]]).min(0)
    np.testing.assert_array_equal(HAND.distance(points, GraspType.BASIC), expected)


def test_closing_region_is_ahead_of_the_palm_between_the_fingers() -> None:
    depth = HAND.gripper.closing_depth
    points = np.array([[depth, 0.0, 0.0], [-0.05, 0.0, 0.0], [depth, 0.3, 0.0], [depth, 0.0, 0.2], [0.4, 0.0, 0.0]])
    assert HAND.between_fingers(points).tolist() == [True, False, False, False, False]


def test_lowest_point_of_a_hand_that_points_down(downward) -> None:
    pose = np.eye(4)
    pose[:3, :3] = downward
    pose[2, 3] = 0.5
    reach = max(float(placed.corners()[:, 0].max()) for placed in HAND.shapes[GraspType.BASIC])
    assert HAND.lowest(pose, GraspType.BASIC) == pytest.approx(0.5 - reach)
