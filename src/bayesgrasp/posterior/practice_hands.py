"""Hands worth practising: where the posterior puts its mass, and where a search for its maximum ends.

Without an image there is one posterior for all scenes, p(h | S=1), and one likelihood, p(S=1 | h). Both maxima are
practised, and their surroundings: what counts is by how much a hand beside the maximum is worse.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from bayesgrasp.geometry.grasp_space import GraspSpace
from bayesgrasp.posterior.ascent import AscentConfig, ascend
from bayesgrasp.posterior.importance import weigh
from bayesgrasp.posterior.maxima import search_maxima
from bayesgrasp.posterior.potential import (
    LogDensity,
    Prior,
    likelihood_potential,
    posterior_potential,
    support,
)
from bayesgrasp.seeding import torch_child
from bayesgrasp.types import Hands

STARTS = 4
"""Starts of a search per grasp type, as a planner has them."""
BESIDE = 0.05
"""Standard deviation of hands beside such an end, radians along each axis of the metric: 2.9 degrees and 5 mm."""


def practice_hands(
    log_ratio: LogDensity, prior: Prior, count: int, rng: np.random.Generator, num_draws: int = 1000
) -> Hands:
    """Hands for one image: a third drawn from the posterior, a third where a search ends, a third beside these ends.

    The best end of each grasp type comes first, then the second of each: a model that believes in one type alone would
    never learn that another one holds what this one drops.

    Args:
        log_ratio: log r(S=1, i | h), up to a constant.
        prior: p(h).
        count: How many hands, at least 3.
        rng: Source of the draws.
        num_draws: Draws from the prior that the posterior is resampled from.
    """
    weighted, generator = weigh(log_ratio, prior, num_draws, rng), torch_child(rng)
    third = count // 3
    ends = _best_of_each_type(
        log_ratio, search_maxima(log_ratio, prior, weighted.hands, weighted.log_ratio, STARTS, rng)
    )[:third]
    beside = BESIDE * GraspSpace().per_radian(ends.position)
    near = GraspSpace().retract(ends, beside * torch.randn(*ends.shape, 6, generator=generator))
    near = replace(near, position=support(prior).clip(near.position))
    return Hands.cat([weighted.resample(count - 2 * ends.shape[0], generator), ends, near])


def _best_of_each_type(log_ratio: LogDensity, hands: Hands) -> Hands:
    """The same hands: the best of each grasp type, best first, then the second of each, and so on."""
    with torch.no_grad():
        best_first = hands[log_ratio(hands).argsort(descending=True)]
    same = best_first.grasp_type == best_first.grasp_type[:, None]
    return best_first[same.tril().sum(-1).argsort(stable=True)]


BLIND_STEPS = 20
"""Steps of the search for a maximum without an image: those of the strategies that are to do better by it."""
SPREAD = (0.015, 0.15)
"""Standard deviations of the surroundings of a maximum: metres and radians, along each axis."""


def blind_hands(
    log_ratio: LogDensity, prior: Prior, count: int, rng: np.random.Generator, num_draws: int = 20_000
) -> Hands:
    """Hands for any scene: a third from p(h | S=1), a third around its maxima, a third around those of p(S=1 | h).

    Args:
        log_ratio: log r(S=1 | h), up to a constant.
        prior: p(h).
        count: How many hands, at least 3.
        rng: Source of the draws.
        num_draws: Draws from the prior that p(h | S=1) is resampled from.
    """
    generator = torch_child(rng)
    drawn = weigh(log_ratio, prior, num_draws, rng).resample(count, generator)
    third = count // 3
    parts = [drawn[: count - 2 * third]]
    for part, potential in enumerate((posterior_potential(log_ratio, prior), likelihood_potential(log_ratio, prior))):
        starts = drawn[count - 2 * third + part * third :][:third]
        best = ascend(potential, starts, AscentConfig(steps=BLIND_STEPS)).hands
        near = GraspSpace().retract(best, _surroundings(third, generator))
        parts.append(Hands(potential.box.clip(near.position), near.rotation, near.grasp_type))
    return Hands.cat(parts)


def _surroundings(count: int, generator: torch.Generator) -> torch.Tensor:
    """Tangent vectors (v, w), shape (count, 6); a half of them is null, so that the maximum itself is tried."""
    spread = torch.tensor([SPREAD[0]] * 3 + [SPREAD[1]] * 3)
    away = torch.arange(count)[:, None] % 2
    return away * spread * torch.randn(count, 6, generator=generator)
