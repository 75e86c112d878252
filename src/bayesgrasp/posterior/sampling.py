"""Posterior samples: importance resampling from the prior (Rubin 1988), refined by Hamiltonian chains.

With p(h | S=1, i) = r(S=1, i | h) p(h), draws h_j ~ p(h) carry weights w_j = r(h_j) / sum_k r(h_k). Resampling by
weight is exact in the limit of many draws; the effective sample size 1 / sum_j w_j^2 says how far off that limit is,
and the mean of r (1 for an exact ratio) is a check of the ratio itself. Resampled draws repeat; as the first states of
chains that leave the posterior invariant (`chain`) they spread out, and the chains need no long warm-up.
"""

import math
from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.posterior.chain import ChainConfig, run_chains
from bayesgrasp.posterior.potential import LogDensity, Prior, likelihood_potential, posterior_potential
from bayesgrasp.seeding import torch_child
from bayesgrasp.types import Hands


@dataclass(frozen=True)
class Weighted:
    """Draws from the prior with their posterior weights.

    Attributes:
        hands: Draws from the prior, (n,).
        log_ratio: log r of each, up to a constant of the ratio, (n,).
        weight: Normalised weights, float64, (n,).
    """

    hands: Hands
    log_ratio: Float[Tensor, "n"]
    weight: Float[Tensor, "n"]

    @property
    def effective_sample_size(self) -> float:
        """1 / sum of squared weights: how many equal draws from the posterior these are worth."""
        return 1.0 / float(self.weight.square().sum())

    @property
    def log_mean_ratio(self) -> float:
        """Log of the mean of r under the prior: 0 for an exact likelihood-to-evidence ratio."""
        return float(torch.logsumexp(self.log_ratio.double(), 0)) - math.log(len(self.log_ratio))

    def resample(self, n: int, generator: torch.Generator) -> Hands:
        """Draw n hands by weight, in random order (systematic resampling, the least variance of the usual schemes)."""
        return self.hands[systematic(self.weight, n, generator)]


def weigh(log_ratio: LogDensity, prior: Prior, num_draws: int, rng: np.random.Generator) -> Weighted:
    """Draw from the prior and weigh by the ratio.

    Args:
        log_ratio: log r(S=1, i | h), up to a constant.
        prior: p(h).
        num_draws: Draws from the prior.
        rng: Source of the draws.

    Raises:
        InvalidConfigurationError: No draw has a finite log-ratio.
    """
    hands = prior.sample(num_draws, rng)
    values = -likelihood_potential(log_ratio, prior).value(hands)
    if not values.isfinite().any():
        raise InvalidConfigurationError(f"the log-ratio is not finite at any of {num_draws} draws from the prior")
    return Weighted(hands, values, torch.softmax(values.double(), 0))


def systematic(weight: Float[Tensor, "n"], count: int, generator: torch.Generator) -> Int[Tensor, "{count}"]:
    """Indices of systematic resampling: index j appears floor or ceil of count * w_j times."""
    draws = torch.rand((), generator=generator, dtype=torch.float64, device=weight.device)
    points = (torch.arange(count, dtype=torch.float64, device=weight.device) + draws) / count
    index = torch.searchsorted(weight.double().cumsum(0) / weight.double().sum(), points).clamp(max=len(weight) - 1)
    return index[torch.randperm(count, generator=generator, device=weight.device)]


@dataclass(frozen=True)
class SamplerConfig:
    """Cost and quality of `sample_posterior`.

    Attributes:
        num_draws: Draws from the prior.
        chains: Chains, started at resampled draws.
        chain: Steps of the chains.
    """

    num_draws: int = 8192
    chains: int = 500
    chain: ChainConfig = field(default_factory=ChainConfig)

    def __post_init__(self) -> None:
        if self.num_draws < 1 or self.chains < 1:
            raise InvalidConfigurationError("num_draws and chains must be positive")


@dataclass(frozen=True)
class PosteriorSample:
    """Draws from p(h | S=1, i) and what is known about their quality.

    Attributes:
        hands: Draws, (n,).
        effective_sample_size: Of the importance weights that the chains started from.
        log_mean_ratio: log E_{p(h)}[r]; 0 for an exact ratio.
        acceptance: Of the chains' trajectories.
        jump_acceptance: Of the jumps between grasp types and quarter turns.
    """

    hands: Hands
    effective_sample_size: float
    log_mean_ratio: float
    acceptance: float
    jump_acceptance: float


def sample_posterior(
    log_ratio: LogDensity, prior: Prior, n: int, rng: np.random.Generator, config: SamplerConfig | None = None
) -> PosteriorSample:
    """Draw n hands from p(h | S=1, i): importance resampling, then chains.

    Args:
        log_ratio: log r(S=1, i | h), up to a constant.
        prior: p(h).
        n: Number of draws; they come from `config.chains` chains, so neighbours in time are correlated.
        rng: Source of randomness.
        config: Cost and quality.
    """
    if n < 1:
        raise InvalidConfigurationError(f"the number of posterior samples must be positive, got {n}")
    config = config or SamplerConfig()
    generator = torch_child(rng)
    weighted = weigh(log_ratio, prior, config.num_draws, rng)
    starts = weighted.resample(min(n, config.chains), generator)
    trajectories = -(-n // len(starts.grasp_type))
    run = run_chains(posterior_potential(log_ratio, prior), starts, trajectories, generator, config.chain)
    return PosteriorSample(
        run.flat()[:n],
        weighted.effective_sample_size,
        weighted.log_mean_ratio,
        run.acceptance,
        run.jump_acceptance,
    )
