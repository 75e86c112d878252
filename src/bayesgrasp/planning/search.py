"""Candidates for a grasp: where the ascents end, and the best draws from the prior.

A robot wants the hand that most probably succeeds; the posterior has its mode elsewhere where p(S=1 | i, h) is flat
(`selection`). So both maxima are searched for, in one batch of ascents: a weight w of the log-prior leads to the MAP
(w = 1) or, inside the prior's box, to the MLE (w = 0).

Under constraints the ascents start at draws that keep them and never leave what is allowed, as they never leave the
prior's box; there are more draws where few are allowed, and more of them are candidates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.planning.constraints import ConstraintCheck
from bayesgrasp.planning.selection import Candidates
from bayesgrasp.posterior.ascent import AscentConfig, ascend, starting_points
from bayesgrasp.posterior.importance import Weighted, weigh
from bayesgrasp.posterior.posterior import Posterior
from bayesgrasp.posterior.potential import tempered_potential
from bayesgrasp.types import Hands

QUICK = AscentConfig(starts_per_type=4, steps=12, backtracks=4, decrease_tolerance=5e-3, gradient_tolerance=1e-2)
"""More starts than Algorithm 2, and no more precision than a robot can use."""
AMONG_OBSTACLES = replace(QUICK, starts_per_type=16, steps=20, backtracks=8)
"""Under constraints an ascent may end at a wall of what is allowed, so more of them start."""
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
        constrained: The search under constraints.
        allowed_draws: Under constraints, so many draws that keep them are wanted, and may all be tried.
        rounds: For them, `num_draws` are drawn at most so often.
    """

    num_draws: int = 2000
    ascent: AscentConfig = QUICK
    fallbacks: int = 30
    constrained: AscentConfig = AMONG_OBSTACLES
    allowed_draws: int = 200
    rounds: int = 10

    def __post_init__(self) -> None:
        if min(self.num_draws, self.allowed_draws, self.rounds) < 1 or self.fallbacks < 0:
            raise InvalidConfigurationError(
                "a search needs num_draws, allowed_draws and rounds >= 1, and fallbacks >= 0"
            )


def search(
    posterior: Posterior, drawn: Weighted, config: SearchConfig, check: ConstraintCheck | None, rng: np.random.Generator
) -> tuple[Candidates | None, str | None]:
    """Candidates in the workspace frame, or the reason why there is none.

    Args:
        posterior: What is searched.
        drawn: Draws from its prior.
        config: Cost.
        check: What candidates must keep to, if anything.
        rng: Of further draws, where few of the first keep to it.
    """
    if check is None:
        return _candidates(posterior, drawn.hands, drawn.log_ratio, config.ascent, config.fallbacks), None
    hands, log_ratio = _allowed(posterior, drawn, config, check, rng)
    if len(log_ratio) == 0:
        return None, check.why_none(drawn.hands)
    return _candidates(posterior, hands, log_ratio, config.constrained, config.allowed_draws, check.allows), None


def _allowed(
    posterior: Posterior, drawn: Weighted, config: SearchConfig, check: ConstraintCheck, rng: np.random.Generator
) -> tuple[Hands, Float[Tensor, "n"]]:
    """Draws that keep the constraints, with their log-ratios."""
    kept: list[Hands] = []
    values: list[Tensor] = []
    for number in range(config.rounds):
        if number:
            drawn = weigh(posterior.log_ratio, posterior.prior, config.num_draws, rng, posterior.device)
        rows = check.allows(drawn.hands) & drawn.log_ratio.isfinite()
        kept.append(drawn.hands[rows])
        values.append(drawn.log_ratio[rows])
        if sum(map(len, values)) >= config.allowed_draws:
            break
    return Hands.cat(kept), torch.cat(values)


def _candidates(
    posterior: Posterior,
    draws: Hands,
    log_ratio: Float[Tensor, "n"],
    ascent: AscentConfig,
    fallbacks: int,
    allowed: Callable[[Hands], Bool[Tensor, "n"]] | None = None,
) -> Candidates:
    with torch.no_grad():
        log_prior = posterior.prior.log_prob(draws)
    starts = [starting_points(draws, -(log_ratio + w * log_prior), ascent.starts_per_type) for w in TEMPERS]
    weight = torch.cat([log_prior.new_full(hands.shape, w) for w, hands in zip(TEMPERS, starts, strict=True)])
    potential = replace(tempered_potential(posterior.log_ratio, posterior.prior, weight), allowed=allowed)
    ends = ascend(potential, Hands.cat(starts), ascent).hands
    best = (-(log_ratio + log_prior)).argsort()[:fallbacks]
    return _judged(posterior, Hands.cat([ends, draws[best]]))


def _judged(posterior: Posterior, hands: Hands) -> Candidates:
    with torch.no_grad():
        log_ratio, log_prior = posterior.log_ratio(hands), posterior.prior.log_prob(hands)
        probability = posterior.success(log_ratio)
    log_posterior = log_ratio + log_prior - posterior.evidence.log_mean
    return Candidates(hands.to("cpu"), log_posterior.cpu(), probability.cpu())
