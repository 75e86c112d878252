"""The lift test: outcomes that anybody would agree with, exact screening, and independence of everything else."""

from dataclasses import replace

import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.trials import Priors, draw_attempts
from bayesgrasp.lift.execution import LiftConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.seeding import generator
from bayesgrasp.types import Attempts, GraspType, Outcome

DOWN = (1.0, 0.0, 1.0, 0.0)


@pytest.fixture(scope="module")
def objects() -> tuple[ObjectAsset, ...]:
    return load_objects(["household_drink_can", "household_tea_box", "household_ball", "household_coffee_mug"])


@pytest.fixture(scope="module")
def lift_test(objects: tuple[ObjectAsset, ...]) -> LiftTest:
    return LiftTest(objects)


def attempt(
    position: tuple[float, float, float],
    quaternion: tuple[float, float, float, float] = DOWN,
    grasp_type: GraspType = GraspType.BASIC,
    index: int = 0,
    friction: float = 0.8,
    mass_factor: float = 1.0,
) -> Attempts:
    one = np.ones(1, np.float32)
    return Attempts(
        position=np.array([position], np.float32),
        quaternion=np.array([quaternion], np.float32),
        grasp_type=np.array([grasp_type], np.uint8),
        object_index=np.array([index], np.int32),
        scale=one,
        object_pose=np.zeros((1, 3), np.float32),
        lateral_friction=friction * one,
        spinning_friction=0.004 * one,
        mass_factor=mass_factor * one,
    )


def height(asset: ObjectAsset) -> float:
    return float(asset.vertices[:, 2].max())


@pytest.mark.parametrize("grasp_type", [GraspType.BASIC, GraspType.PINCH])
def test_a_can_grasped_from_above_is_lifted(
    lift_test: LiftTest, objects: tuple[ObjectAsset, ...], grasp_type: GraspType
) -> None:
    grasp = attempt((0.0, 0.0, max(0.19, height(objects[0]) + 0.07)), grasp_type=grasp_type)
    assert lift_test.run(grasp)[0] == Outcome.SUCCESS


def test_wide_fingers_pass_a_narrow_can(lift_test: LiftTest, objects: tuple[ObjectAsset, ...]) -> None:
    """Spread by 11 degrees, the fingertips are 13 cm apart: the thumb pushes a can of 66 mm through between them."""
    grasp = attempt((0.0, 0.0, max(0.19, height(objects[0]) + 0.07)), grasp_type=GraspType.WIDE)
    assert lift_test.run(grasp)[0] == Outcome.DROPPED


def test_a_slippery_can_of_lead_is_dropped(lift_test: LiftTest, objects: tuple[ObjectAsset, ...]) -> None:
    grasp = attempt((0.0, 0.0, max(0.19, height(objects[0]) + 0.07)), friction=0.02, mass_factor=30.0)
    assert lift_test.run(grasp)[0] == Outcome.DROPPED


def test_beside_the_can_is_no_contact(lift_test: LiftTest) -> None:
    assert lift_test.run(attempt((0.0, 0.22, 0.25)))[0] == Outcome.NO_CONTACT


def test_through_the_table_is_a_collision(lift_test: LiftTest) -> None:
    assert lift_test.run(attempt((0.0, 0.0, 0.12)))[0] == Outcome.COLLISION


def test_a_finger_on_the_can_is_a_collision(lift_test: LiftTest) -> None:
    assert lift_test.run(attempt((0.0, 0.09, 0.19)))[0] == Outcome.COLLISION


def test_a_pose_beyond_the_arm_is_unreachable(lift_test: LiftTest) -> None:
    assert lift_test.run(attempt((1.5, 0.0, 0.3)))[0] == Outcome.UNREACHABLE


def test_screening_never_changes_an_outcome(objects: tuple[ObjectAsset, ...], lift_test: LiftTest) -> None:
    """On a small number here; `benchmarks/screening.py` compares 20,000 attempts over all objects."""
    attempts = draw_attempts(250, len(objects), Priors(), generator(11, 0))
    np.testing.assert_array_equal(lift_test.run(attempts), LiftTest(objects, screening=False).run(attempts))


def test_an_outcome_depends_on_its_attempt_alone(lift_test: LiftTest, objects: tuple[ObjectAsset, ...]) -> None:
    attempts = draw_attempts(150, len(objects), Priors(), generator(12, 0))
    forward = lift_test.run(attempts)
    np.testing.assert_array_equal(lift_test.run(attempts[::-1])[::-1], forward)
    touched = np.flatnonzero((forward == Outcome.SUCCESS) | (forward == Outcome.DROPPED))[:5]
    assert [LiftTest(objects).run(attempts[[row]])[0] for row in touched] == list(forward[touched])


def test_observing_gives_the_same_outcome(lift_test: LiftTest, objects: tuple[ObjectAsset, ...]) -> None:
    grasp, seen = attempt((0.0, 0.0, max(0.19, height(objects[0]) + 0.07))), []
    assert lift_test.observe(grasp, lambda _, data: seen.append(data.time)) == lift_test.run(grasp)[0]
    assert len(seen) > 50
    assert np.all(np.diff(seen) > 0)


def test_feasible_means_neither_unreachable_nor_in_collision(
    lift_test: LiftTest, objects: tuple[ObjectAsset, ...]
) -> None:
    attempts = draw_attempts(300, len(objects), Priors(), generator(13, 0))
    outcomes, feasible = lift_test.run(attempts), lift_test.feasible(attempts)
    assert not feasible[(outcomes == Outcome.UNREACHABLE) | (outcomes == Outcome.COLLISION)].any()
    assert feasible[(outcomes == Outcome.SUCCESS) | (outcomes == Outcome.DROPPED)].all()


def test_divergence_is_an_outcome(objects: tuple[ObjectAsset, ...]) -> None:
    lift_test = LiftTest(objects)
    grasp = attempt((0.0, 0.0, max(0.19, height(objects[0]) + 0.07)))
    assert lift_test.run(grasp)[0] == Outcome.SUCCESS
    rig = lift_test.benches[0].rig
    rig.model.opt.gravity[:] = (0.0, 0.0, np.inf)
    assert lift_test.run(grasp)[0] == Outcome.DIVERGED


def test_attempts_that_are_not_finite_or_name_no_object_are_refused(lift_test: LiftTest) -> None:
    good = attempt((0.0, 0.0, 0.2))
    with pytest.raises(InvalidConfigurationError, match="position is not finite"):
        lift_test.run(replace(good, position=np.full((1, 3), np.nan, np.float32)))
    with pytest.raises(InvalidConfigurationError, match="the lift test has 4 objects"):
        lift_test.run(replace(good, object_index=np.array([4], np.int32)))


def test_a_criterion_that_makes_no_sense_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError):
        LiftConfig(success_rise=1.5)
    with pytest.raises(InvalidConfigurationError):
        LiftConfig(hold_time=0.0)
