"""The posterior of one image as an object, against the closed form of the analytic problem."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.grasp_space import GraspSpace, carried
from bayesgrasp.known.analytic import AnalyticGrasping
from bayesgrasp.posterior.importance import estimate_evidence, weigh
from bayesgrasp.posterior.posterior import Posterior
from bayesgrasp.posterior.potential import support
from bayesgrasp.posterior.sampling import SamplerConfig
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Hands

PRIOR = GraspPrior()
QUICK = SamplerConfig(num_draws=4000, chains=200)


@pytest.fixture(scope="module")
def known():
    """The log-ratio of one image, and its exact posterior."""
    problem = AnalyticGrasping(PRIOR)
    image = problem.sample_successes(1, generator(60, Stream.ATTEMPT)).image[0]

    def log_ratio(hands: Hands) -> torch.Tensor:
        return problem.log_success_given_image(image, hands)

    return log_ratio, problem.posterior(image)


@pytest.fixture(scope="module")
def posterior(known):
    return replace(Posterior.of(known[0], PRIOR, torch.exp, num_draws=20_000), sampler=QUICK)


@pytest.fixture(scope="module")
def turned(posterior):
    """The same posterior in a world that is turned and shifted."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([0.0, 0.0, 1.0]).as_matrix()
    pose[:3, 3] = 0.3, -0.2, 0.0
    return replace(posterior, workspace_to_world=pose)


def test_density_is_the_exact_one_up_to_the_error_of_its_constant(known, posterior) -> None:
    _, exact = known
    hands = exact.sample(500, generator(61, Stream.ATTEMPT))
    difference = posterior.log_prob(hands) - exact.log_prob(hands)
    assert difference.std() < 1e-4
    assert abs(float(difference.mean())) < 4 * posterior.evidence.standard_error < 0.3
    assert posterior.evidence.log_mean == pytest.approx(exact.log_evidence, abs=4 * posterior.evidence.standard_error)


def test_density_integrates_to_one(known, posterior) -> None:
    hands = PRIOR.sample(100_000, generator(62, Stream.ATTEMPT))
    weight = (posterior.log_prob(hands) - PRIOR.log_prob(hands)).double().exp()
    error = math.hypot(float(weight.std()) / math.sqrt(len(weight)), posterior.evidence.standard_error)
    assert float(weight.mean()) == pytest.approx(1.0, abs=4 * error)


def test_the_standard_error_is_the_spread_of_the_estimate(known) -> None:
    drawn = [weigh(known[0], PRIOR, 1000, generator(63, Stream.ATTEMPT, k)) for k in range(150)]
    found = [estimate_evidence(d.log_ratio) for d in drawn]
    spread = np.std([e.log_mean for e in found])
    assert np.sqrt(np.mean([e.standard_error**2 for e in found])) == pytest.approx(spread, rel=0.25)
    assert {e.num_draws for e in found} == {1000}


def test_a_constant_ratio_has_an_exact_evidence() -> None:
    found = estimate_evidence(torch.full((64,), -2.5, dtype=torch.float64))
    assert found.log_mean == pytest.approx(-2.5)
    assert found.standard_error == pytest.approx(0.0, abs=1e-7)
    for wrong in (-torch.inf, torch.nan):
        with pytest.raises(InvalidConfigurationError, match="no finite mean"):
            estimate_evidence(torch.full((4,), wrong))


def test_outside_the_support_the_density_is_zero(posterior) -> None:
    hands = PRIOR.sample(4, generator(64, Stream.ATTEMPT))
    away = Hands(hands.position + 1.0, hands.rotation, hands.grasp_type)
    assert (posterior.log_prob(away) == -torch.inf).all()


def test_hands_come_and_go_in_the_world_frame(posterior, turned) -> None:
    hands = PRIOR.sample(50, generator(65, Stream.ATTEMPT))
    there = carried(hands, turned.workspace_to_world)
    torch.testing.assert_close(turned.log_prob(there), posterior.log_prob(hands), atol=1e-3, rtol=1e-4)
    chance = posterior.success_probability(hands)
    torch.testing.assert_close(turned.success_probability(there), chance, atol=1e-5, rtol=1e-3)
    for moved, still in (
        (turned.sample(40, seed=2).hands, posterior.sample(40, seed=2).hands),
        (turned.mode(seed=3)[None], posterior.mode(seed=3)[None]),
    ):
        assert GraspSpace().distance(moved, carried(still, turned.workspace_to_world)).max() < 2e-3
        assert moved.rotation.dtype == torch.float32
    drawn = turned.sample(40, seed=2).hands
    back = carried(drawn, np.linalg.inv(turned.workspace_to_world))
    for box, position in ((turned.region, drawn.position), (support(PRIOR), back.position)):
        assert (box.clip(position) - position).abs().max() < 1e-6


def test_draws_are_those_of_the_seed(posterior) -> None:
    first, again, other = (posterior.sample(30, seed=seed) for seed in (4, 4, 5))
    assert torch.equal(first.hands.position, again.hands.position)
    assert not torch.equal(first.hands.position, other.hands.position)
    assert first.effective_sample_size > 50
    assert first.evidence.log_mean == pytest.approx(posterior.evidence.log_mean, abs=4 * first.evidence.standard_error)


def test_the_mode_is_no_worse_than_any_draw(posterior) -> None:
    mode = posterior.mode()
    assert mode.shape == ()
    assert posterior.log_prob(mode) >= posterior.log_prob(posterior.sample(500).hands).max() - 0.05


def test_every_batch_shape(posterior) -> None:
    hands = PRIOR.sample(6, generator(66, Stream.ATTEMPT))
    square = Hands(hands.position.view(2, 3, 3), hands.rotation.view(2, 3, 3, 3), hands.grasp_type.view(2, 3))
    for values in (posterior.log_prob, posterior.success_probability):
        torch.testing.assert_close(values(square).flatten(), values(hands))
        assert values(hands[0]).shape == ()


def test_success_is_unknown_unless_told(known) -> None:
    bare = Posterior.of(known[0], PRIOR, num_draws=1000)
    with pytest.raises(InvalidConfigurationError, match="success"):
        bare.success_probability(PRIOR.sample(1, generator(67, Stream.ATTEMPT)))
    with pytest.raises(InvalidConfigurationError, match="seed"):
        bare.sample(3, seed=-1)
