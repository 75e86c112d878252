"""Hands worth practising: where the posterior puts its mass, and where a search for its maximum ends."""

from __future__ import annotations

import numpy as np

from bayesgrasp.posterior.ascent import AscentConfig, ascend
from bayesgrasp.posterior.importance import weigh
from bayesgrasp.posterior.potential import LogDensity, Prior, posterior_potential
from bayesgrasp.seeding import torch_child
from bayesgrasp.types import Hands

STEPS = (3, 10)
"""Steps of the two kinds of search: halfway up, and nearly at the top."""


def practice_hands(
    log_ratio: LogDensity, prior: Prior, count: int, rng: np.random.Generator, num_draws: int = 2000
) -> Hands:
    """Hands for one image: a third drawn from the posterior, a third from there a little uphill, a third at its top.

    Args:
        log_ratio: log r(S=1, i | h), up to a constant.
        prior: p(h).
        count: How many hands, at least 3.
        rng: Source of the draws.
        num_draws: Draws from the prior that the posterior is resampled from.
    """
    drawn = weigh(log_ratio, prior, num_draws, rng).resample(count, torch_child(rng))
    third = count // 3
    potential = posterior_potential(log_ratio, prior)
    parts = [drawn[: count - 2 * third]]
    for part, steps in enumerate(STEPS):
        starts = drawn[count - 2 * third + part * third :][:third]
        parts.append(ascend(potential, starts, AscentConfig(steps=steps)).hands)
    return Hands.cat(parts)
