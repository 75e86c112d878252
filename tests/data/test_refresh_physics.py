"""Planar refresh against the real lift test: a moved success is simulated again and succeeds again."""

from dataclasses import replace

import numpy as np

from bayesgrasp.assets.catalogue import load_objects
from bayesgrasp.data.generate import ChunkMaker, GenerateConfig, SimulatedWorld
from bayesgrasp.data.planar import PlanarRefresh
from bayesgrasp.data.proposal import Proposal
from bayesgrasp.data.schema import AttemptRecords
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import Outcome

ATTEMPTS = 1500


def test_refreshed_successes_succeed_and_originals_repeat_exactly() -> None:
    """Contact is chaotic in the last bits, so a few refreshed attempts may end otherwise; originals may not."""
    config = GenerateConfig(proposal="prior", attempts_per_draw=ATTEMPTS, draws_per_chunk=1)
    world = SimulatedWorld(load_objects(["household_jar"]))()
    maker = ChunkMaker(world, config, 11, ScenePrior(1))
    records = maker.propose(0, ATTEMPTS, Proposal.prior(1))
    outcome = world.lift_test(records)
    success = records[outcome == Outcome.SUCCESS]
    assert len(success) >= 8
    assert (world.lift_test(success) == Outcome.SUCCESS).all()
    refresh = PlanarRefresh(config.grasp, ScenePrior(1), world.reachable)
    assert world.reachable is not None
    there, _ = refresh.redraw(success, np.ones(len(success), bool), np.random.default_rng(0))
    assert world.reachable(there).all()
    assert not np.allclose(there.object_pose, success.object_pose, atol=1e-3)
    assert (world.lift_test(there) == Outcome.SUCCESS).mean() >= 0.75
    assert (world.lift_test(shifted(there)) == Outcome.SUCCESS).mean() < 0.3  # the hand left behind: the test has power


def shifted(attempts: AttemptRecords) -> AttemptRecords:
    """The same hands with the object 8 cm aside."""
    return replace(attempts, object_pose=attempts.object_pose + np.float32([0.08, 0.0, 0.0]))
