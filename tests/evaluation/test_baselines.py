"""The two baselines: geometry that can be checked by hand."""

import numpy as np
import pytest
from box_scene import Box, box_depth_image

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.baselines.contacts import Contacts, closing_hand, first_contacts
from bayesgrasp.evaluation.baselines.force_closure import ForceClosure, ForceClosureConfig, quality, world_to_object
from bayesgrasp.evaluation.baselines.top_down import TopDownConfig, top_down
from bayesgrasp.evaluation.scenes import SceneMaker, Situation
from bayesgrasp.geometry.camera import canonical_camera, network_camera
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.observation.preprocess import preprocess
from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.planning.selection import Robot
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.robot.arm import ur5
from bayesgrasp.robot.arm_over_table import ArmOverTable
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.types import GraspType

CENTER = np.zeros(3)
SLIPPERY, ROUGH = (0.01, 1e-4), (0.8, 0.004)


def contacts(*pairs: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Contacts:
    points, normals = (np.array(side, dtype=float) for side in zip(*pairs, strict=True))
    return Contacts(points, normals, overlap=False)


LEFT, RIGHT = ((0.0, -0.03, 0.0), (0.0, 1.0, 0.0)), ((0.0, 0.03, 0.0), (0.0, -1.0, 0.0))


def test_opposite_contacts_with_friction_are_force_closure() -> None:
    assert quality(contacts(LEFT, RIGHT), CENTER, 0.05, ROUGH) > 0
    assert quality(contacts(LEFT, RIGHT), CENTER, 0.05, ROUGH) > quality(contacts(LEFT, RIGHT), CENTER, 0.05, SLIPPERY)


def test_contacts_on_one_side_are_not() -> None:
    beside = ((0.02, -0.03, 0.0), (0.0, 1.0, 0.0))
    assert quality(contacts(LEFT, beside), CENTER, 0.05, ROUGH) < 0


def test_a_third_contact_never_weakens() -> None:
    beside = ((0.02, -0.03, 0.0), (0.0, 1.0, 0.0))
    two, three = contacts(LEFT, RIGHT), contacts(LEFT, RIGHT, beside)
    assert quality(three, CENTER, 0.05, ROUGH) >= quality(two, CENTER, 0.05, ROUGH) - 1e-12


def test_fingers_close_on_opposite_faces_of_a_box(objects: tuple[ObjectAsset, ...]) -> None:
    """A carton of 70 x 70 x 190 mm, the hand straight above it, closing along y."""
    carton = objects[0]
    hand_to_object = np.eye(4)
    hand_to_object[:3, :3] = np.array([[0, 0, -1], [0, 1, 0], [-1, 0, 0]], dtype=float).T
    hand_to_object[:3, 3] = 0.0, 0.0, 0.19 + 0.06
    hand = closing_hand(robotiq_3f(), GraspType.BASIC)
    found = first_contacts(hand, hand_to_object, carton.parts, 1.0)
    assert len(found.points) == 3
    assert not found.overlap
    np.testing.assert_allclose(np.abs(found.points[:, 1]), 0.035, atol=2e-3)
    np.testing.assert_allclose(np.abs(found.normals[:, 1]), 1.0, atol=1e-6)
    assert (found.points[:, 1] * found.normals[:, 1] < 0).all(), "normals point into the box"
    assert sorted(np.sign(found.points[:, 1])) in ([-1, -1, 1], [-1, 1, 1])
    hand_to_object[2, 3] = 0.19
    assert not len(first_contacts(hand, np.linalg.inv(hand_to_object), carton.parts, 1.0).points)


def test_world_to_object_undoes_the_pose() -> None:
    x, y, yaw = 0.03, -0.02, 0.7
    moved = world_to_object((x, y, yaw)) @ np.array([x, y, 0.1, 1.0])
    np.testing.assert_allclose(moved, [0, 0, 0.1, 1], atol=1e-12)
    ahead = world_to_object((x, y, yaw)) @ np.array([x + np.cos(yaw), y + np.sin(yaw), 0.0, 1.0])
    np.testing.assert_allclose(ahead, [1, 0, 0, 1], atol=1e-12)


def test_force_closure_chooses_what_the_arm_can_do(scenes: SceneMaker, objects: tuple[ObjectAsset, ...]) -> None:
    lift_test = LiftTest(objects)
    strategy = ForceClosure(GraspPrior(), lift_test).choose
    hands = strategy(scenes.make(0), np.random.default_rng(0))
    assert hands.shape == (1,)
    assert lift_test.feasible(scenes.make(0).attempts(hands)).all()
    again = strategy(scenes.make(0), np.random.default_rng(0))
    assert (again.position == hands.position).all()


@pytest.fixture(scope="module")
def reader() -> SurfaceReader:
    return SurfaceReader(network_camera())


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot(OpenHand(robotiq_3f()), ArmOverTable(ur5(), robotiq_3f()))


def seen(scenes: SceneMaker, *boxes: Box) -> Situation:
    """A scene whose image shows boxes."""
    depth = box_depth_image(canonical_camera(), boxes)
    situation = scenes.make(0)
    return Situation(0, situation.asset, situation.scene, situation.nuisances, depth, preprocess(depth))


@pytest.mark.parametrize("yaw", [0.0, 0.6, -1.0])
def test_top_down_closes_across_the_long_side(
    reader: SurfaceReader, robot: Robot, scenes: SceneMaker, yaw: float
) -> None:
    box = Box(x=0.02, y=-0.01, yaw=yaw, size=(0.04, 0.16, 0.06))
    hands = top_down(reader, robot)(seen(scenes, box), np.random.default_rng(0))
    assert hands is not None
    np.testing.assert_allclose(hands.position[0, :2], [0.02, -0.01], atol=0.02)
    approach, closing = hands.rotation[0, :, 0].numpy(), hands.rotation[0, :, 1].numpy()
    np.testing.assert_allclose(approach, [0, 0, -1], atol=1e-6)
    across = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    assert abs(closing @ across) > 0.97
    np.testing.assert_allclose(np.linalg.det(hands.rotation[0].double().numpy()), 1.0, atol=1e-5)
    assert hands.grasp_type[0] == GraspType.WIDE
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = hands.rotation[0].numpy(), hands.position[0].numpy()
    assert robot.hand.lowest(pose, GraspType.WIDE) > 0
    assert robot.arm.plan(pose, GraspType.WIDE) is not None


def test_top_down_declines_an_empty_table(reader: SurfaceReader, robot: Robot, scenes: SceneMaker) -> None:
    assert top_down(reader, robot)(seen(scenes), np.random.default_rng(0)) is None


def test_configurations_are_checked() -> None:
    with pytest.raises(InvalidConfigurationError, match="sizes"):
        TopDownConfig(above_top=-0.01)
    with pytest.raises(InvalidConfigurationError, match="edges"):
        ForceClosureConfig(edges=2)
