"""The harder criterion: strong grasps hold, weak ones do not, and it is never easier than the lift."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.lift.hold import DIRECTIONS, HoldConfig
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.types import Attempts, GraspType, Outcome


@pytest.fixture(scope="module")
def objects() -> tuple[ObjectAsset, ...]:
    return load_objects(["household_drink_can"])


@pytest.fixture(scope="module")
def lift_test(objects: tuple[ObjectAsset, ...]) -> LiftTest:
    return LiftTest(objects)


def grasp(objects: tuple[ObjectAsset, ...], friction: float = 0.8, mass_factor: float = 1.0) -> Attempts:
    one = np.ones(1, np.float32)
    height = max(0.19, float(objects[0].vertices[:, 2].max()) + 0.07)
    return Attempts(
        position=np.array([[0.0, 0.0, height]], np.float32),
        quaternion=np.array([[1.0, 0.0, 1.0, 0.0]], np.float32),
        grasp_type=np.array([GraspType.BASIC], np.uint8),
        object_index=np.zeros(1, np.int32),
        scale=one,
        object_pose=np.zeros((1, 3), np.float32),
        lateral_friction=friction * one,
        spinning_friction=0.004 * one,
        mass_factor=mass_factor * one,
    )


def pushed(objects: tuple[ObjectAsset, ...], **changes: float) -> LiftTest:
    return LiftTest(objects, LiftTestConfig(hold=HoldConfig(**changes)))


def test_a_strong_grasp_holds(lift_test: LiftTest, objects: tuple[ObjectAsset, ...]) -> None:
    verdicts = lift_test.judge(grasp(objects))
    assert (verdicts.outcomes[0], verdicts.held[0]) == (Outcome.SUCCESS, True)


def test_stronger_pushes_break_a_grasp_that_lifts(objects: tuple[ObjectAsset, ...]) -> None:
    held = [bool(pushed(objects, acceleration=a).judge(grasp(objects)).held[0]) for a in (0.0, 10.0, 1000.0)]
    assert held == [True, True, False]


def test_a_narrower_tolerance_is_harder(objects: tuple[ObjectAsset, ...]) -> None:
    assert pushed(objects).judge(grasp(objects)).held[0]
    assert not pushed(objects, largest_shift=1e-6).judge(grasp(objects)).held[0]
    assert not pushed(objects, largest_turn=1e-5).judge(grasp(objects)).held[0]


def test_weakened_friction_loses_the_hold_before_the_lift(
    lift_test: LiftTest, objects: tuple[ObjectAsset, ...]
) -> None:
    """With ever less friction on a heavy can, what is lost first is the hold."""
    frictions = np.geomspace(0.9, 0.02, 9)
    verdicts = lift_test.judge(Attempts.cat([grasp(objects, float(f), 6.0) for f in frictions]))
    lifted = verdicts.outcomes == Outcome.SUCCESS
    assert lifted[0]
    assert not lifted[-1]
    assert not verdicts.held[-1]
    assert not (verdicts.held & ~lifted).any()
    assert verdicts.held.sum() < lifted.sum()


def test_the_label_beside_the_lift_changes_no_outcome(lift_test: LiftTest, objects: tuple[ObjectAsset, ...]) -> None:
    attempts = Attempts.cat([grasp(objects, f) for f in (0.02, 0.3, 0.8)])
    np.testing.assert_array_equal(lift_test.judge(attempts).outcomes, lift_test.run(attempts))


def test_asked_for_it_is_the_meaning_of_success(objects: tuple[ObjectAsset, ...]) -> None:
    hold = HoldConfig(acceleration=1000.0)
    easy, hard = (LiftTest(objects, LiftTestConfig(criterion=c, hold=hold)) for c in ("lift", "hold"))
    assert easy.run(grasp(objects))[0] == Outcome.SUCCESS
    assert hard.run(grasp(objects))[0] == Outcome.DROPPED
    assert hard.config.settings()["hold"]["acceleration"] == 1000.0
    assert "hold" not in easy.config.settings()


def test_pushes_come_from_six_sides_and_cancel() -> None:
    assert len(np.unique(DIRECTIONS, axis=0)) == 6
    np.testing.assert_array_equal(DIRECTIONS.sum(axis=0), 0.0)


@pytest.mark.parametrize(
    "wrong", [{"acceleration": -1.0}, {"push_time": 0.0}, {"largest_shift": 0.0}, {"largest_turn": 4.0}]
)
def test_wrong_pushes_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidConfigurationError):
        HoldConfig(**wrong)
    assert replace(HoldConfig(), largest_turn=math.pi).largest_turn == math.pi
