"""p(h | S=1, i) of one image as an object: density, draws, marginals, mode.

    log p(h | S=1, i) = log r(S=1, i | h) + log p(h) - log Z,    Z = E_{p(h)} r

with respect to metres cubed, the surface measure of the unit quaternions (total 2 pi^2) and the counting measure on
grasp types (`docs/conventions.md`). Z is a Monte Carlo estimate with a standard error (`importance`).

Hands go in and come out in the world frame. The log-ratio and the prior are defined in the workspace frame, where the
prior's box is axis-aligned and in which the network was trained; a rigid motion leads from one to the other, which
keeps the reference measure, so densities are the same numbers in both.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.box import Box
from bayesgrasp.geometry.grasp_space import carried
from bayesgrasp.posterior.ascent import AscentConfig, find_map
from bayesgrasp.posterior.importance import Evidence, estimate_evidence, weigh
from bayesgrasp.posterior.marginals import Marginals, marginals_of
from bayesgrasp.posterior.potential import LogDensity, Prior, evaluate, posterior_potential, support
from bayesgrasp.posterior.sampling import PosteriorSample, SamplerConfig, sample_posterior
from bayesgrasp.seeding import Stream, generator_of
from bayesgrasp.types import Hands

Seed = int | np.random.Generator
"""A seed, or a generator whose next numbers are taken."""
THOROUGH = AscentConfig(starts_per_type=8, steps=40)
"""A search that hardly ever ends on a lesser hill; its starts are one batch."""


def _unknown(log_ratio: Tensor) -> Tensor:
    raise InvalidConfigurationError("this posterior was made without `success`, so it knows no p(S=1 | i, h)")


@dataclass(frozen=True)
class Posterior:
    """p(h | S=1, i) of one image.

    Attributes:
        log_ratio: log r(S=1, i | h) up to a constant, of hands in the workspace frame.
        prior: p(h), likewise.
        evidence: log Z, estimated.
        success: From values of the log-ratio to estimates of p(S=1 | i, h).
        workspace_to_world: From the frame of the log-ratio and the prior to that of everything that goes in and out.
        device: Where the log-ratio takes hands.
        sampler: Cost and quality of draws.
    """

    log_ratio: LogDensity
    prior: Prior
    evidence: Evidence
    success: Callable[[Tensor], Tensor] = _unknown
    workspace_to_world: Float64[np.ndarray, "4 4"] = field(default_factory=lambda: np.eye(4))
    device: torch.device = field(default_factory=lambda: torch.device("cpu"))
    sampler: SamplerConfig = field(default_factory=SamplerConfig)

    @staticmethod
    def of(
        log_ratio: LogDensity,
        prior: Prior,
        success: Callable[[Tensor], Tensor] = _unknown,
        num_draws: int = 10_000,
        seed: Seed = 0,
    ) -> Posterior:
        """The posterior of any log-ratio and prior, on the CPU, in their own frame.

        Args:
            log_ratio: log r(S=1, i | h) up to a constant.
            prior: p(h).
            success: From values of the log-ratio to p(S=1 | i, h), if known.
            num_draws: Draws from the prior behind the evidence.
            seed: Of these draws.
        """
        drawn = weigh(log_ratio, prior, num_draws, generator_of(seed, Stream.EVIDENCE))
        return Posterior(log_ratio, prior, estimate_evidence(drawn.log_ratio.double()), success)

    def log_prob(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Log p(h | S=1, i), nats, on the hands' device, without gradient; -inf outside the prior's support."""
        value = -posterior_potential(self.log_ratio, self.prior).value(self._in_workspace(hands))
        return (value - self.evidence.log_mean).to(hands.position.device)

    def success_probability(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Estimates of p(S=1 | i, h), on the hands' device; meaningful inside the prior's support only.

        Raises:
            InvalidConfigurationError: This posterior does not know how its ratio depends on it.
        """
        return self.success(evaluate(self.log_ratio, self._in_workspace(hands))).to(hands.position.device)

    def sample(self, n: int, seed: Seed = 0) -> PosteriorSample:
        """Draw n hands, on the CPU.

        Args:
            n: How many.
            seed: The same seed gives the same draws.
        """
        rng = generator_of(seed, Stream.POSTERIOR_SAMPLE)
        drawn = sample_posterior(self.log_ratio, self.prior, n, rng, self.sampler, self.device)
        return replace(drawn, hands=self._in_world(drawn.hands))

    def marginals(self, n: int = 2000, seed: Seed = 0, bins: int = 20) -> Marginals:
        """Marginals of position, approach direction and grasp type.

        Args:
            n: Draws that they are counted from.
            seed: Of the draws, as in `sample`.
            bins: Cells of each coordinate.
        """
        return marginals_of(self.sample(n, seed).hands, self.region, bins)

    def mode(self, seed: Seed = 0, config: AscentConfig = THOROUGH, num_draws: int = 2000) -> Hands:
        """The MAP estimate by Algorithm 2 of the paper with more starts and steps, of batch shape (), on the CPU.

        Args:
            seed: Of the draws from the prior that the search starts at.
            config: The search; the paper's is `AscentConfig()`.
            num_draws: Such draws of a pose; each is tried with every grasp type.
        """
        rng, potential = generator_of(seed, Stream.POSTERIOR_MODE), posterior_potential(self.log_ratio, self.prior)
        return self._in_world(find_map(potential, self.prior, rng, num_draws, config, self.device).best)

    @property
    def region(self) -> Box:
        """The smallest box of the world frame that holds the prior's box of positions."""
        box = support(self.prior)
        corners = np.array(list(itertools.product(*zip(box.low, box.high, strict=True))))
        corners = corners @ self.workspace_to_world[:3, :3].T + self.workspace_to_world[:3, 3]
        return Box(tuple(corners.min(0)), tuple(corners.max(0)))

    def _in_workspace(self, hands: Hands) -> Hands:
        return carried(hands.to(self.device), np.linalg.inv(self.workspace_to_world))

    def _in_world(self, hands: Hands) -> Hands:
        return carried(hands.to("cpu"), self.workspace_to_world)
