"""Posterior samples: importance resampling from the prior (`importance`), refined by Hamiltonian chains (`chain`).

Resampled draws repeat; as the first states of chains that leave the posterior invariant they spread out, and the
chains need no long warm-up.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import torch

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.posterior.chain import ChainConfig, run_chains
from bayesgrasp.posterior.importance import Evidence, estimate_evidence, weigh
from bayesgrasp.posterior.potential import LogDensity, Prior, posterior_potential
from bayesgrasp.seeding import torch_child
from bayesgrasp.types import Hands


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
        evidence: The constant of the posterior, by the same draws from the prior; 0 for an exact ratio.
        acceptance: Of the chains' trajectories.
        jump_acceptance: Of the jumps between grasp types and quarter turns.
    """

    hands: Hands
    effective_sample_size: float
    evidence: Evidence
    acceptance: float
    jump_acceptance: float


def sample_posterior(
    log_ratio: LogDensity,
    prior: Prior,
    n: int,
    rng: np.random.Generator,
    config: SamplerConfig | None = None,
    device: torch.device | str = "cpu",
) -> PosteriorSample:
    """Draw n hands from p(h | S=1, i): importance resampling, then chains.

    Args:
        log_ratio: log r(S=1, i | h), up to a constant.
        prior: p(h).
        n: Number of draws; they come from `config.chains` chains, so neighbours in time are correlated.
        rng: Source of randomness.
        config: Cost and quality.
        device: Where the log-ratio takes hands; the draws stay there.
    """
    if n < 1:
        raise InvalidConfigurationError(f"the number of posterior samples must be positive, got {n}")
    config = config or SamplerConfig()
    generator = torch_child(rng, device)
    weighted = weigh(log_ratio, prior, config.num_draws, rng, device)
    starts = weighted.resample(min(n, config.chains), generator)
    trajectories = -(-n // len(starts.grasp_type))
    run = run_chains(posterior_potential(log_ratio, prior), starts, trajectories, generator, config.chain)
    return PosteriorSample(
        run.flat()[:n],
        weighted.effective_sample_size,
        estimate_evidence(weighted.log_ratio.double()),
        run.acceptance,
        run.jump_acceptance,
    )
