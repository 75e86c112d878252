"""Draws from the prior, weighted by the ratio: resampling (Rubin 1988) and the evidence.

With p(h | S=1, i) = r(S=1, i | h) p(h) / Z and Z = E_{p(h)} r, draws h_j ~ p(h) carry weights
w_j = r(h_j) / sum_k r(h_k). Resampling by weight is exact in the limit of many draws; the effective sample size
1 / sum_j w_j^2 says how far off that limit is. The mean of r over the draws estimates Z:

    log Z ~ log (1/n) sum_j r(h_j),    standard error of the logarithm ~ sqrt(1 / ESS - 1 / n)    (delta method).

Z is 1 for an exact likelihood-to-evidence ratio. A ratio that is known up to a constant, such as p(S=1 | i, h), has
another Z, and r p(h) is a density only once it is divided by it: every normalised log-posterior of this package uses
`estimate_evidence`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.posterior.potential import LogDensity, Prior, likelihood_potential
from bayesgrasp.types import Hands


@dataclass(frozen=True)
class Evidence:
    """Monte Carlo estimate of log Z, the constant of the posterior.

    Attributes:
        log_mean: log of the mean of r over draws from the prior, nats.
        standard_error: Of `log_mean`, nats.
        num_draws: How many draws.
    """

    log_mean: float
    standard_error: float
    num_draws: int


def estimate_evidence(log_ratio: Float[Tensor, "n"]) -> Evidence:
    """The evidence from the log-ratios of n independent draws from the prior, in the precision that they have.

    Raises:
        InvalidConfigurationError: None of them is finite, or one is NaN.
    """
    n = len(log_ratio)
    log_mean = float(torch.logsumexp(log_ratio, 0) - math.log(n))
    if not math.isfinite(log_mean):
        raise InvalidConfigurationError(f"the log-ratios of {n} draws from the prior have no finite mean")
    return Evidence(log_mean, math.sqrt(max(0.0, 1.0 / _effective(_normalised(log_ratio)) - 1.0 / n)), n)


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
        return _effective(self.weight)

    def resample(self, n: int, generator: torch.Generator) -> Hands:
        """Draw n hands by weight, in random order (systematic resampling, the least variance of the usual schemes)."""
        return self.hands[systematic(self.weight, n, generator)]


def weigh(
    log_ratio: LogDensity,
    prior: Prior,
    num_draws: int,
    rng: np.random.Generator,
    device: torch.device | str = "cpu",
) -> Weighted:
    """Draw from the prior and weigh by the ratio.

    Args:
        log_ratio: log r(S=1, i | h), up to a constant.
        prior: p(h).
        num_draws: Draws from the prior.
        rng: Source of the draws.
        device: Where the log-ratio takes hands.

    Raises:
        InvalidConfigurationError: No draw has a finite log-ratio.
    """
    hands = prior.sample(num_draws, rng).to(device)
    values = -likelihood_potential(log_ratio, prior).value(hands)
    if not values.isfinite().any():
        raise InvalidConfigurationError(f"the log-ratio is not finite at any of {num_draws} draws from the prior")
    return Weighted(hands, values, _normalised(values))


def systematic(weight: Float[Tensor, "n"], count: int, generator: torch.Generator) -> Int[Tensor, "{count}"]:
    """Indices of systematic resampling: index j appears floor or ceil of count * w_j times."""
    draws = torch.rand((), generator=generator, dtype=torch.float64, device=weight.device)
    points = (torch.arange(count, dtype=torch.float64, device=weight.device) + draws) / count
    index = torch.searchsorted(weight.double().cumsum(0) / weight.double().sum(), points).clamp(max=len(weight) - 1)
    return index[torch.randperm(count, generator=generator, device=weight.device)]


def _normalised(log_ratio: Float[Tensor, "n"]) -> Float[Tensor, "n"]:
    return torch.softmax(log_ratio.double(), 0)


def _effective(weight: Float[Tensor, "n"]) -> float:
    return 1.0 / float(weight.square().sum())
