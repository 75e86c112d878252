"""Hands other than the Robotiq 3-Finger in the lift test: joints that mimic one another, slides, nothing held."""

import mujoco
import numpy as np
import pytest
from jaws import STROKE, jaws

from bayesgrasp.generation.trials import Priors, draw_attempts
from bayesgrasp.lift.hand_kinematics import HandKinematics
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.robot.robotiq_2f_85 import robotiq_2f_85
from bayesgrasp.seeding import generator
from bayesgrasp.types import Attempts, GraspType, Outcome

HANDS = {hand.name: hand for hand in (robotiq_2f_85(), jaws())}
PRIOR = GraspPrior(z=(0.04, 0.26))
"""Palms 8 cm lower than those of the Robotiq 3-Finger, whose fingers are as much longer."""


@pytest.fixture(scope="module")
def objects() -> tuple[ObjectAsset, ...]:
    return load_objects(["household_drink_can", "household_ball", "household_coffee_mug"])


@pytest.fixture(params=HANDS)
def hand(request: pytest.FixtureRequest) -> GripperDescription:
    return HANDS[request.param]


def from_above(height: float, friction: float = 0.8) -> Attempts:
    one = np.ones(1, np.float32)
    return Attempts(
        position=np.array([[0.0, 0.0, height]], np.float32),
        quaternion=np.array([[1.0, 0.0, 1.0, 0.0]], np.float32),
        grasp_type=np.zeros(1, np.uint8),
        object_index=np.zeros(1, np.int32),
        scale=one,
        object_pose=np.zeros((1, 3), np.float32),
        lateral_friction=friction * one,
        spinning_friction=0.004 * one,
        mass_factor=one,
    )


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_a_can_is_lifted_and_held_unless_it_is_slippery(
    engine: str, hand: GripperDescription, objects: tuple[ObjectAsset, ...]
) -> None:
    if engine == "pybullet":
        pytest.importorskip("pybullet", reason="the second engine is the optional extra bayesgrasp[pybullet]")
    lift_test = LiftTest(objects[:1], LiftTestConfig(engine=engine), gripper=hand)
    above = float(objects[0].vertices[:, 2].max()) + 0.04
    verdicts = lift_test.judge(from_above(above))
    assert verdicts.outcomes[0] == Outcome.SUCCESS
    assert verdicts.held[0]
    assert lift_test.run(from_above(above, friction=0.02))[0] == Outcome.DROPPED


def test_screening_never_changes_an_outcome(hand: GripperDescription, objects: tuple[ObjectAsset, ...]) -> None:
    attempts = draw_attempts(300, len(objects), Priors(grasp=PRIOR), generator(11, 0))
    screened = LiftTest(objects, gripper=hand).run(attempts)
    np.testing.assert_array_equal(screened, LiftTest(objects, gripper=hand, screening=False).run(attempts))
    assert Outcome.DROPPED in screened or Outcome.SUCCESS in screened


def test_what_can_be_touched_contains_the_hand_at_every_moment(hand: GripperDescription) -> None:
    kinematics = HandKinematics(hand)
    regions = kinematics.touchable_regions(GraspType.BASIC, 0.1)
    for angles in kinematics.free_closing(GraspType.BASIC, 0.01):
        for shapes in kinematics.link_points(angles).values():
            for points, radius in shapes:
                covered = [(r.normals @ points.T).max(axis=1) + radius <= r.offsets + 1e-9 for r in regions]
                assert any(inside.all() for inside in covered)


def test_the_open_hand_is_where_the_physics_has_it(hand: GripperDescription) -> None:
    kinematics = HandKinematics(hand)
    kinematics.link_points(hand.open_angles(GraspType.BASIC))
    for placed, geom in zip(OpenHand(hand).shapes[GraspType.BASIC], geoms(kinematics, hand), strict=True):
        np.testing.assert_allclose(placed.shape_to_hand[:3, 3], kinematics.data.geom_xpos[geom], atol=1e-12)


def geoms(kinematics: HandKinematics, hand: GripperDescription) -> list[int]:
    names = [f"{link.name}_{index}" for link in hand.links for index in range(len(link.shapes))]
    return [kinematics.model.geom(name).id for name in names]


def test_jaws_slide_together_and_their_pads_stay_parallel() -> None:
    kinematics = HandKinematics(jaws())
    angles = kinematics.free_closing(GraspType.BASIC, 0.01)
    np.testing.assert_allclose(angles[:, 0], angles[:, 1], atol=0.002)
    assert angles[-1, 0] == pytest.approx(STROKE - 0.001, abs=0.002)
    kinematics.data.qpos[kinematics.hand.qpos] = angles[-1]
    mujoco.mj_kinematics(kinematics.model, kinematics.data)
    left, right = (kinematics.data.body(f"jaw_{name}") for name in ("left", "right"))
    np.testing.assert_allclose(left.xpos, [0.0, angles[-1, 0] - STROKE, 0.0], atol=1e-9)
    np.testing.assert_allclose(right.xpos, [0.0, STROKE - angles[-1, 1], 0.0], atol=1e-9)
