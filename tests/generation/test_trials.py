"""Lift tests from the prior: the same for any number of workers, other ones for another seed, stream or number."""

import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.trials import CHUNK, Simulation
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.seeding import Stream


def test_same_seed_same_result_for_any_number_of_workers() -> None:
    objects = load_objects(["household_ball", "household_tea_box"])
    told: list[int] = []
    alone = Simulation(objects, seed=5).run(CHUNK + 50, 1, lambda trials: told.append(len(trials.outcomes)))
    together = Simulation(objects, seed=5).run(CHUNK + 50, workers=2)
    assert told == [CHUNK, 50]
    np.testing.assert_array_equal(alone.outcomes, together.outcomes)
    for name, column in alone.attempts.columns().items():
        np.testing.assert_array_equal(column, together.attempts.columns()[name], err_msg=name)
    other = Simulation(objects, seed=6).run(50)
    assert not np.array_equal(other.attempts.position, alone.attempts.position[:50])


def test_attempts_are_numbered_within_their_stream() -> None:
    objects = load_objects(["household_ball"])
    first = Simulation(objects, seed=5).attempts(range(20))
    others = (
        Simulation(objects, seed=5).attempts(range(CHUNK, CHUNK + 20)),
        Simulation(objects, seed=5, number=1).attempts(range(20)),
        Simulation(objects, seed=5, stream=Stream.FRESH_TRIAL).attempts(range(20)),
        Simulation(objects, seed=6).attempts(range(20)),
    )
    places = {tuple(attempts.position[0].tolist()) for attempts in (first, *others)}
    assert len(places) == 1 + len(others)


def test_simulation_needs_something_to_do() -> None:
    with pytest.raises(InvalidConfigurationError, match="at least one"):
        Simulation((), 0).run(10)
    with pytest.raises(InvalidConfigurationError, match="at least one"):
        Simulation(load_objects(["household_ball"]), 0).run(10, workers=0)
