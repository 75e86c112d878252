"""Importance resampling and Hamiltonian chains against exact draws from a closed-form posterior."""

import math

import pytest
import torch

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.box import Box
from bayesgrasp.known.analytic import AnalyticGrasping
from bayesgrasp.posterior.chain import ChainConfig, fold, run_chains
from bayesgrasp.posterior.importance import estimate_evidence, systematic, weigh
from bayesgrasp.posterior.potential import (
    Potential,
    likelihood_potential,
    posterior_potential,
    prior_potential,
    support,
)
from bayesgrasp.posterior.sampling import SamplerConfig, sample_posterior
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.seeding import generator, torch_generator
from bayesgrasp.types import Hands

PRIOR = GraspPrior()


def features(hands: Hands) -> torch.Tensor:
    """Moments of position and rotation, their coupling, and the type: (*batch, 22)."""
    x, R = 10 * hands.position.double(), hands.rotation.double().flatten(-2)
    kinds = torch.nn.functional.one_hot(hands.grasp_type, 3).double()
    return torch.cat([x, x.square(), R, x[..., :1] * R[..., :4], kinds], -1)


@pytest.fixture(scope="module")
def known():
    """A log-ratio, and many exact draws from its posterior."""
    problem = AnalyticGrasping(PRIOR)
    image = problem.sample_successes(1, generator(20)).image[0]
    exact = problem.posterior(image)

    def log_ratio(hands: Hands) -> torch.Tensor:
        return problem.log_success_given_image(image, hands)

    return log_ratio, exact, exact.sample(100_000, generator(21))


def standardised_error(draws: Hands, truth: Hands) -> torch.Tensor:
    expected = features(truth)
    return ((features(draws).mean(0) - expected.mean(0)) / expected.std(0)).abs()


def test_chains_leave_the_posterior_invariant(known) -> None:
    """Started at exact draws, the mean over chains stays exact; its error is known from the spread between chains."""
    log_ratio, exact, truth = known
    starts = exact.sample(600, generator(22))
    run = run_chains(posterior_potential(log_ratio, PRIOR), starts, 40, torch_generator(23), ChainConfig(warmup=15))
    per_chain = features(run.hands).mean(0)
    error = per_chain.std(0) / math.sqrt(600)
    z = (per_chain.mean(0) - features(truth).mean(0)) / error
    assert z.abs().max() < 4
    assert (error / features(truth).std(0)).max() < 0.05
    assert 0.5 < run.acceptance < 0.8
    assert run.jump_acceptance > 0.2


@pytest.mark.parametrize("leapfrog", [1, 3])
def test_a_wrong_target_is_noticed(known, leapfrog) -> None:
    """The same check fails for a posterior that is tempered by half: the test above can fail."""
    log_ratio, exact, truth = known
    starts = exact.sample(600, generator(24))
    potential = posterior_potential(lambda h: 0.5 * log_ratio(h), PRIOR)
    run = run_chains(potential, starts, 40, torch_generator(25), ChainConfig(warmup=15, leapfrog=leapfrog))
    per_chain = features(run.hands).mean(0)
    z = (per_chain.mean(0) - features(truth).mean(0)) / (per_chain.std(0) / math.sqrt(600))
    assert z.abs().max() > 6


def test_importance_and_chains_agree_with_the_truth_and_each_other(known) -> None:
    log_ratio, exact, truth = known
    weighted = weigh(log_ratio, PRIOR, 60_000, generator(26))
    resampled = weighted.resample(5000, torch_generator(27))
    drawn = sample_posterior(log_ratio, PRIOR, 5000, generator(28), SamplerConfig(num_draws=16384))
    assert 1000 < weighted.effective_sample_size < 60_000
    assert estimate_evidence(weighted.log_ratio).log_mean == pytest.approx(exact.log_evidence, abs=0.1)
    assert standardised_error(resampled, truth).max() < 0.1
    assert standardised_error(drawn.hands, truth).max() < 0.15
    assert standardised_error(resampled, drawn.hands).max() < 0.15
    assert len(drawn.hands.grasp_type) == 5000


def test_chains_reach_the_prior_from_one_corner() -> None:
    """Reflections keep a flat density flat, up to the faces."""
    corner = PRIOR.sample(1, generator(29))
    starts = corner[torch.zeros(800, dtype=torch.int64)]
    starts.position[:] = support(PRIOR).clip(torch.tensor([-1.0, -1.0, -1.0]))
    config = ChainConfig(warmup=0, leapfrog=4, step=0.5)
    run = run_chains(prior_potential(PRIOR), starts, 60, torch_generator(30), config)
    late = run.hands[30:]
    assert PRIOR.in_support(run.hands).all()
    low, high = torch.tensor(PRIOR.low), torch.tensor(PRIOR.high)
    unit = ((late.position - low) / (high - low)).flatten(0, 1)
    histogram = torch.stack([torch.histc(unit[:, k], 10, 0, 1) for k in range(3)]) / len(unit)
    assert (histogram - 0.1).abs().max() < 0.01
    truth = PRIOR.sample(50_000, generator(31))
    assert standardised_error(run.flat()[30 * 800 :], truth).max() < 0.06


def test_fold_reflects_as_often_as_needed() -> None:
    box = Box((0.0, 0.0, 0.0), (1.0, 1.0, 2.0))
    position = torch.tensor([[0.25, 1.25, -0.5], [2.25, -1.25, 4.5], [3.5, 0.0, 2.0]], dtype=torch.float64)
    folded, sign = fold(position, box)
    expected = torch.tensor([[0.25, 0.75, 0.5], [0.25, 0.75, 0.5], [0.5, 0.0, 2.0]], dtype=torch.float64)
    torch.testing.assert_close(folded, expected)
    assert sign.tolist() == [[1, -1, -1], [1, 1, 1], [-1, 1, 1]]


def test_same_generator_same_draws(known) -> None:
    log_ratio, _, _ = known
    config = SamplerConfig(num_draws=500, chains=20, chain=ChainConfig(warmup=2))
    first, second = (sample_posterior(log_ratio, PRIOR, 50, generator(32), config).hands for _ in range(2))
    assert torch.equal(first.position, second.position)
    assert torch.equal(first.rotation, second.rotation)


def test_systematic_resampling_is_proportional() -> None:
    weight = torch.tensor([0.5, 0.25, 0.0, 0.25], dtype=torch.float64)
    counts = torch.bincount(systematic(weight, 400, torch_generator(33)), minlength=4)
    assert counts.tolist() == [200, 100, 0, 100]


def test_what_cannot_be_sampled_is_refused() -> None:
    never = likelihood_potential(lambda h: torch.full(h.shape, -torch.inf), PRIOR)
    starts = PRIOR.sample(3, generator(35))
    with pytest.raises(InvalidConfigurationError, match="finite"):
        run_chains(never, starts, 2, torch_generator(36))
    with pytest.raises(InvalidConfigurationError, match="not finite at any"):
        weigh(never.terms[0], PRIOR, 10, generator(37))
    with pytest.raises(InvalidConfigurationError, match="must be positive"):
        sample_posterior(lambda h: torch.zeros(h.shape), PRIOR, 0, generator(38))
    with pytest.raises(InvalidConfigurationError):
        ChainConfig(leapfrog=0)
    with pytest.raises(InvalidConfigurationError):
        ChainConfig(jitter=1.0)
    assert isinstance(never, Potential)
