"""Candidates for a grasp: where the ascents end, and the best draws from the prior.

A robot wants the hand that most probably succeeds, the posterior has its mode elsewhere where p(S=1 | i, h) is flat
(`selection`). So both maxima are searched for, in one batch of ascents: a weight w of the log-prior leads to the MAP
(w = 1) or, inside the prior's box, to the MLE (w = 0).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.planning.selection import Candidates
from bayesgrasp.posterior.ascent import AscentConfig, ascend, starting_points
from bayesgrasp.posterior.importance import Weighted
from bayesgrasp.posterior.posterior import Posterior
from bayesgrasp.posterior.potential import tempered_potential
from bayesgrasp.types import Hands

QUICK = AscentConfig(starts_per_type=4, steps=12, backtracks=4, decrease_tolerance=5e-3, gradient_tolerance=1e-2)
"""More starts than Algorithm 2, and no more precision than a robot can use."""
TEMPERS = (1.0, 0.0)
"""Weights of the log-prior in the ascents: they lead to the MAP and to the MLE."""


@dataclass(frozen=True)
class SearchConfig:
    """Cost of the search.

    Attributes:
        num_draws: Draws from the prior that compete for the starts; more than in Algorithm 2, since each is tried with
            its own grasp type only.
        ascent: The search; by default four starts per grasp type for the maximum of the posterior, and as many for that
            of the likelihood inside the prior's box.
        fallbacks: Of the best draws, how many are tried where the ends of the search cannot be executed.
    """

    num_draws: int = 2000
    ascent: AscentConfig = QUICK
    fallbacks: int = 30

    def __post_init__(self) -> None:
        if self.num_draws < 1 or self.fallbacks < 0:
            raise InvalidConfigurationError("a search needs num_draws >= 1 and fallbacks >= 0")


def search(posterior: Posterior, drawn: Weighted, config: SearchConfig) -> Candidates:
    """Candidates in the workspace frame.

    Args:
        posterior: What is searched.
        drawn: Draws from its prior.
        config: Cost.
    """
    prior, draws, log_ratio = posterior.prior, drawn.hands, drawn.log_ratio
    with torch.no_grad():
        log_prior = prior.log_prob(draws)
    per_type = config.ascent.starts_per_type
    starts = [starting_points(draws, -(log_ratio + weight * log_prior), per_type) for weight in TEMPERS]
    weight = torch.cat([log_prior.new_full(hands.shape, w) for w, hands in zip(TEMPERS, starts, strict=True)])
    ends = ascend(tempered_potential(posterior.log_ratio, prior, weight), Hands.cat(starts), config.ascent).hands
    best = (-(log_ratio + log_prior)).argsort()[: config.fallbacks]
    return _judged(posterior, Hands.cat([ends, draws[best]]))


def _judged(posterior: Posterior, hands: Hands) -> Candidates:
    with torch.no_grad():
        log_ratio, log_prior = posterior.log_ratio(hands), posterior.prior.log_prob(hands)
        probability = posterior.success(log_ratio)
    log_posterior = log_ratio + log_prior - posterior.evidence.log_mean
    return Candidates(hands.to("cpu"), log_posterior.cpu(), probability.cpu())
