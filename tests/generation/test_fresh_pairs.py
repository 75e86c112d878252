"""Fresh pairs: each image is of the scene of its own attempt, outcomes are the lift test's, weights are the prior's."""

import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.fresh_pairs import FreshPairs, fresh_pairs
from bayesgrasp.generation.trials import Trials
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects

OBJECTS = load_objects("stand-ins")
SEEN: list[Trials] = []


@pytest.fixture(scope="module")
def pairs() -> FreshPairs:
    return fresh_pairs(OBJECTS, 3, 20, seed=1, progress=SEEN.append)


def test_there_are_enough_successes_and_they_come_first(pairs: FreshPairs) -> None:
    found = int(pairs.success.sum())
    assert found == sum(trials.successes for trials in SEEN) >= 3
    assert (pairs.success[:found] == 1).all()
    assert len(pairs.success) == len(pairs.images) == len(pairs.attempts) == found + 20


def test_weighted_failures_stand_for_all_of_them(pairs: FreshPairs) -> None:
    made = sum(len(trials.outcomes) for trials in SEEN)
    assert pairs.weight.sum() == pytest.approx(made, rel=1e-5)
    assert (pairs.weight[pairs.success == 1] == 1).all()


def test_outcomes_are_those_of_the_attempts(pairs: FreshPairs) -> None:
    some = np.r_[0:3, len(pairs.success) - 5 : len(pairs.success)]
    again = LiftTest(OBJECTS).run(pairs.attempts[some]) == 4
    np.testing.assert_array_equal(again, pairs.success[some] == 1)


def test_images_show_an_object(pairs: FreshPairs) -> None:
    """Something stands nearer to the camera than the table in every image, at another place in each."""
    nearest = np.where(pairs.images > 0, pairs.images, 9.0).reshape(len(pairs.images), -1)
    assert len(np.unique(nearest.argmin(1))) > 5
    assert ((pairs.images == 0) | ((pairs.images >= 0.45) & (pairs.images <= 1.0))).all()


def test_nothing_to_judge_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="at least one success"):
        fresh_pairs(OBJECTS, 0, 5, seed=1)
