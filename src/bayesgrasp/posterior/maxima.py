"""Where searches for the maxima of the posterior and of the likelihood end: one batch of both kinds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from bayesgrasp.posterior.ascent import starting_points
from bayesgrasp.posterior.potential import LogDensity, Prior, tempered_potential
from bayesgrasp.posterior.refine import RefineConfig, refine
from bayesgrasp.types import Hands

TEMPERS = (1.0, 0.0)
"""Weights of the log-prior in the search: they lead to the MAP and to the MLE."""


def search_maxima(
    log_ratio: LogDensity,
    prior: Prior,
    draws: Hands,
    values: Float[Tensor, "n"],
    starts: int,
    rng: np.random.Generator,
    config: RefineConfig | None = None,
    allowed: Callable[[Hands], Bool[Tensor, "n"]] | None = None,
) -> Hands:
    """The ends of the searches, (m,), as `refine` orders them.

    Args:
        log_ratio: log r(S=1, i | h), up to a constant.
        prior: p(h).
        draws: Hands that compete for the starts, (n,).
        values: Their log-ratios.
        starts: Per grasp type, for the maximum of the posterior, and as many for that of the likelihood inside the
            prior's box.
        rng: Of the trials.
        config: Of the search from there.
        allowed: Which hands may be searched; all by default.
    """
    with torch.no_grad():
        log_prior = prior.log_prob(draws)
    chosen = [starting_points(draws, -(values + w * log_prior), starts) for w in TEMPERS]
    goal = torch.cat([torch.full_like(hands.grasp_type, number) for number, hands in enumerate(chosen)])
    weight = log_prior.new_tensor(TEMPERS)[goal]
    potential = replace(tempered_potential(log_ratio, prior, weight), allowed=allowed)
    return refine(potential, Hands.cat(chosen), goal, rng, config)
