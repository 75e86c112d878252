"""Planar refresh: exact in distribution, and it respects the arm."""

from dataclasses import replace

import fake_world
import numpy as np
import pytest
from scipy import stats

from bayesgrasp.data.schema import AttemptRecords
from bayesgrasp.generation.chunks import ChunkMaker, GenerateConfig, World
from bayesgrasp.generation.proposal import Proposal
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.planar_symmetry import PlanarRefresh, moved, to_object, to_world
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import Outcome

SCENE = ScenePrior(fake_world.OBJECTS)
GRASP = GraspPrior(kappa=120.0)
"""Narrower than the paper's, so that the prior of rotations matters more in a move."""


def prior_attempts(n: int, seed: int, grasp: GraspPrior = GRASP) -> AttemptRecords:
    config = GenerateConfig(proposal="prior", attempts_per_draw=n, draws_per_chunk=1, grasp=grasp)
    maker = ChunkMaker(World(fake_world.lift_test, fake_world.render), config, seed, SCENE)
    return maker.propose(0, n, Proposal.prior(fake_world.OBJECTS))


def successes(n: int, seed: int) -> AttemptRecords:
    records = prior_attempts(n, seed)
    records = replace(records, object_index=np.zeros(n, np.int32))
    return records[fake_world.lift_test(records) == Outcome.SUCCESS]


def statistics(attempts: AttemptRecords) -> dict[str, np.ndarray]:
    """Numbers whose laws are compared: of the hand in the world, of the object, and of the hand on the object."""
    relative = to_object(attempts)
    w, x, y, z = attempts.quaternion.T.astype(np.float64)
    closing = np.arctan2(2 * (x * y - w * z), 1 - 2 * (x * x + z * z))
    return {
        "world x": attempts.position[:, 0],
        "world y": attempts.position[:, 1],
        "world z": attempts.position[:, 2],
        "closing direction": closing,
        "closing direction among the four modes": np.mod(closing, np.pi / 2),
        "approach": 2 * (x * z - w * y),
        "object x": attempts.object_pose[:, 0],
        "object y": attempts.object_pose[:, 1],
        "object yaw": attempts.object_pose[:, 2],
        "relative x": relative.position[:, 0],
        "relative y": relative.position[:, 1],
        "hand minus object yaw": np.mod(closing - attempts.object_pose[:, 2], np.pi),
    }


def p_values(one: AttemptRecords, two: AttemptRecords) -> dict[str, float]:
    a, b = statistics(one), statistics(two)
    return {name: stats.ks_2samp(a[name], b[name]).pvalue for name in a}


def test_there_and_back() -> None:
    attempts = prior_attempts(100, 0)
    position, quaternion = to_world(to_object(attempts), attempts.object_pose)
    np.testing.assert_allclose(position, attempts.position, atol=1e-7)
    np.testing.assert_allclose(quaternion, attempts.quaternion, atol=1e-6)


def test_a_move_keeps_the_relative_pose() -> None:
    attempts = prior_attempts(100, 0)
    there = moved(attempts, to_object(attempts), prior_attempts(100, 1).object_pose)
    np.testing.assert_allclose(to_object(there).position, to_object(attempts).position, atol=1e-6)
    cosine = np.abs((to_object(there).quaternion * to_object(attempts).quaternion).sum(-1))
    np.testing.assert_allclose(cosine, 1, atol=1e-6)


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.05, -0.05, 0.7), (-0.03, 0.02, 2.5)])
@pytest.mark.parametrize("rotation", ["modes", "uniform"])
def test_marginal_weights_carry_attempts_to_a_given_pose(pose: tuple[float, float, float], rotation: str) -> None:
    """Attempts of any pose, weighted by p(h') / p(rho), are a draw from the prior of hands at the given pose."""
    grasp = GraspPrior(rotation=rotation)  # type: ignore[arg-type]
    attempts, fresh = prior_attempts(4000, 3, grasp), prior_attempts(4000, 4, grasp)
    refresh = PlanarRefresh(grasp, SCENE)
    relative = to_object(attempts)
    there = moved(attempts, relative, np.tile(pose, (len(attempts), 1)))
    weight = np.exp(refresh.log_density(there) - refresh.log_marginal(relative))
    assert weight.mean() == pytest.approx(1, abs=4 * weight.std() / np.sqrt(len(weight)))
    for column in (0, 1, 2):
        for power in (1, 2):
            old, new = weight * there.position[:, column] ** power, fresh.position[:, column] ** power
            error = np.sqrt(old.var() / len(old) + new.var() / len(new))
            assert old.mean() == pytest.approx(new.mean(), abs=4.5 * error)


def test_refreshed_successes_have_the_law_of_fresh_ones() -> None:
    refresh = PlanarRefresh(GRASP, SCENE, fake_world.reachable)
    ours, fresh = successes(40_000, 1), successes(40_000, 2)
    refreshed, _ = refresh.redraw(ours, np.ones(len(ours), bool), np.random.default_rng(0))
    assert len(ours) > 500
    assert fake_world.reachable(refreshed).all()
    assert not np.allclose(refreshed.object_pose, ours.object_pose)
    assert min(p_values(refreshed, fresh).values()) > 1e-4


def test_the_comparison_has_power() -> None:
    """Moves that forget the prior of rotations, or the box, are found out by the same comparison."""
    ours, fresh = successes(40_000, 1), successes(40_000, 2)
    uniform = SCENE.sample_pose(len(ours), np.random.default_rng(0))
    naive = moved(ours, to_object(ours), uniform)
    assert min(p_values(naive, fresh).values()) < 1e-6


def test_unreachable_attempts_stay_unreachable_and_every_move_keeps_the_outcome() -> None:
    attempts = prior_attempts(500, 5)
    reached = fake_world.reachable(attempts)
    refresh = PlanarRefresh(GRASP, SCENE, fake_world.reachable)
    there, trials = refresh.redraw(attempts, reached, np.random.default_rng(0))
    np.testing.assert_array_equal(fake_world.reachable(there), reached)
    assert (trials >= 1).all()
    before, after = fake_world.lift_test(attempts), fake_world.lift_test(there)
    assert (before != after).mean() < 5e-3  # rounding to float32 at the border of a class


def test_trials_undo_the_thinning_by_reach() -> None:
    """The mean of trials over reached attempts is 1 / P(reachable), so its sum counts all attempts."""
    attempts = prior_attempts(6000, 6)
    reached = fake_world.reachable(attempts)
    refresh = PlanarRefresh(GRASP, SCENE, fake_world.reachable)
    members = attempts[reached]
    _, trials = refresh.redraw(members, np.ones(len(members), bool), np.random.default_rng(0))
    z = to_object(members).position[:, 2]
    all_z = to_object(attempts).position[:, 2]
    high = 0.2
    estimate, truth = (trials * (z > high)).sum(), (all_z > high).sum()
    # Hands that the arm hardly ever reaches have few representatives with large counts: hence the wide interval.
    assert estimate == pytest.approx(truth, rel=0.1)
    assert (z > high).sum() < 0.95 * truth
