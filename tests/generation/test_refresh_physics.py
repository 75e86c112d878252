"""Planar refresh against the real lift test: refreshed successes, simulated again, succeed as often as originals.

An attempt simulated again with everything as it was repeats bit for bit, which says nothing. The lift test is a draw
from p(S | h, O, p_O) once its nuisances are drawn anew, and if a refresh leaves p(h, O, p_O | S = 1) as it is, such
draws succeed equally often at refreshed and at original successes.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from bayesgrasp.data.schema import AttemptRecords
from bayesgrasp.generation.chunks import ChunkMaker, GenerateConfig, SimulatedWorld, World
from bayesgrasp.generation.proposal import Proposal
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.prior.planar_symmetry import PlanarRefresh
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import Attempts, Outcome

ATTEMPTS, TRIES = 1500, 4
CONFIG = GenerateConfig(proposal="prior", attempts_per_draw=ATTEMPTS, draws_per_chunk=1, scenes_per_draw=0)


Held = Callable[[Attempts], np.ndarray]


@pytest.fixture(scope="module")
def world() -> World:
    return SimulatedWorld(load_objects(["household_jar"])).build()


@pytest.fixture(scope="module")
def held() -> Held:
    """Which attempts succeed; nobody asks here whether they withstand pushes as well."""
    test = LiftTest(load_objects(["household_jar"]))
    return lambda attempts: test.run(attempts) == Outcome.SUCCESS


@pytest.fixture(scope="module")
def successes(world: World, held: Held) -> AttemptRecords:
    records = ChunkMaker(world, CONFIG, 11, ScenePrior(1)).propose(0, ATTEMPTS, Proposal.prior(1))
    found = records[held(records)]
    assert len(found) >= 8
    return found


def with_new_nuisances(attempts: AttemptRecords, seed: int) -> AttemptRecords:
    drawn = CONFIG.nuisance.sample(len(attempts), np.random.default_rng(seed))
    return replace(attempts, **drawn.columns())


def difference(one: np.ndarray, two: np.ndarray) -> float:
    """The p value of equal rates."""
    table = [[int(x.sum()), int((~x).sum())] for x in (one, two)]
    return float(stats.fisher_exact(table).pvalue)


def test_a_stored_attempt_repeats_exactly(held: Held, successes: AttemptRecords) -> None:
    assert held(successes).all()


def test_refreshed_successes_succeed_as_often_as_originals(world: World, held: Held, successes: AttemptRecords) -> None:
    refresh = PlanarRefresh(CONFIG.grasp, ScenePrior(1), world.reachable)
    originals = successes[np.repeat(np.arange(len(successes)), TRIES)]
    there, _ = refresh.redraw(originals, np.ones(len(originals), bool), np.random.default_rng(0))
    assert world.reachable is not None
    assert world.reachable(there).all()
    assert not np.allclose(there.object_pose, originals.object_pose, atol=1e-3)
    here = held(with_new_nuisances(originals, 1))
    moved = held(with_new_nuisances(there, 2))
    assert difference(here, moved) > 1e-3
    assert moved.mean() > here.mean() - 0.15
    behind = held(with_new_nuisances(shifted(there), 2))  # the hand left behind: the comparison has power
    assert difference(here, behind) < 1e-6


def shifted(attempts: AttemptRecords) -> AttemptRecords:
    """The same hands with the object 8 cm aside."""
    return replace(attempts, object_pose=attempts.object_pose + np.float32([0.08, 0.0, 0.0]))
