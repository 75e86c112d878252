"""Candidates for a grasp: where the search ends, and the best draws from the prior.

A robot wants the hand that most probably succeeds; the posterior has its mode elsewhere where p(S=1 | i, h) is flat
(`selection`). So both maxima are searched for, in one batch (`posterior.refine`): a weight w of the log-prior leads to
the MAP (w = 1) or, inside the prior's box, to the MLE (w = 0).

A search that finds the maximum also finds where the network is wrong: spikes of p(S=1 | i, h) that are narrower than
any robot is exact. So its mean over hands a little beside each candidate is estimated, too (`selection`).

Under constraints the search starts at draws that keep them and never leaves what is allowed, as it never leaves the
prior's box; there are more draws where few are allowed, and more of them are candidates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.grasp_space import GraspSpace
from bayesgrasp.planning.constraints import ConstraintCheck
from bayesgrasp.planning.selection import Candidates
from bayesgrasp.posterior.importance import Weighted, weigh
from bayesgrasp.posterior.maxima import search_maxima
from bayesgrasp.posterior.posterior import Posterior
from bayesgrasp.posterior.refine import RefineConfig
from bayesgrasp.types import Hands


@dataclass(frozen=True)
class Effort:
    """What is done for the maxima.

    Attributes:
        starts: Per grasp type, for the maximum of the posterior, and as many for that of the likelihood inside the
            prior's box.
        refine: The search from there.
        fallbacks: Of the best draws, how many are tried where the ends of the search cannot be executed.
    """

    starts: int
    refine: RefineConfig
    fallbacks: int

    def __post_init__(self) -> None:
        if self.starts < 1 or self.fallbacks < 0:
            raise InvalidConfigurationError(f"a search needs starts >= 1 and fallbacks >= 0, got {self}")


PLAIN = Effort(4, RefineConfig(), 30)
"""As much precision as decides between grasps."""
AMONG_OBSTACLES = Effort(16, RefineConfig(kept=(48, 24, 16, 12, 8, 6, 4, 2), trials=640), 200)
"""Under constraints a search may end at a wall of what is allowed, so more starts stay in it."""


@dataclass(frozen=True)
class SearchConfig:
    """Cost of the search.

    Attributes:
        num_draws: Draws from the prior that compete for the starts, each tried with its own grasp type only.
        plain: What is done without constraints.
        among_obstacles: And under constraints.
        allowed_draws: Under constraints, so many draws that keep them are wanted.
        rounds: For them, `num_draws` are drawn at most so often.
        error: Standard deviation along each axis of the hands beside a candidate, radians in the metric of the search:
            0.05 is 2.9 degrees and 5 mm.
        beside: How many such hands, for each candidate.
    """

    num_draws: int = 1000
    plain: Effort = PLAIN
    among_obstacles: Effort = AMONG_OBSTACLES
    allowed_draws: int = 200
    rounds: int = 20
    error: float = 0.05
    beside: int = 8

    def __post_init__(self) -> None:
        if min(self.num_draws, self.allowed_draws, self.rounds, self.beside) < 1 or not self.error >= 0:
            raise InvalidConfigurationError(
                "a search needs num_draws, allowed_draws, rounds and beside >= 1, and error >= 0"
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
    hands, log_ratio, effort, allowed = drawn.hands, drawn.log_ratio, config.plain, None
    if check is not None:
        hands, log_ratio = _allowed(posterior, drawn, config, check, rng)
        if len(log_ratio) == 0:
            return None, check.why_none(drawn.hands)
        effort, allowed = config.among_obstacles, check.allows
    found = _found(posterior, hands, log_ratio, effort, rng, allowed)
    return _judged(posterior, found, config.error * rng.standard_normal((config.beside, 6), np.float32)), None


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


def _found(
    posterior: Posterior,
    draws: Hands,
    log_ratio: Float[Tensor, "n"],
    effort: Effort,
    rng: np.random.Generator,
    allowed: Callable[[Hands], Bool[Tensor, "n"]] | None = None,
) -> Hands:
    with torch.no_grad():
        log_prior = posterior.prior.log_prob(draws)
    ends = search_maxima(
        posterior.log_ratio, posterior.prior, draws, log_ratio, effort.starts, rng, effort.refine, allowed
    )
    best = (-(log_ratio + log_prior)).argsort()[: effort.fallbacks]
    return Hands.cat([ends, draws[best]])


def _judged(posterior: Posterior, hands: Hands, errors: Float32[np.ndarray, "k 6"]) -> Candidates:
    """Candidates with what they promise, and what hands beside them do, displaced by the same errors for all."""
    count, space = len(hands.grasp_type), GraspSpace()
    scale = space.per_radian(hands.position)
    shift = torch.from_numpy(errors).to(scale) * scale
    rows = torch.arange(count, device=scale.device).repeat_interleave(len(shift))
    with torch.no_grad():
        log_ratio, log_prior = posterior.log_ratio(hands), posterior.prior.log_prob(hands)
        probability = posterior.success(log_ratio)
        near = posterior.success(posterior.log_ratio(space.retract(hands[rows], shift.repeat(count, 1))))
    steady = torch.cat([probability[:, None], near.view(count, -1)], -1).mean(-1)
    log_posterior = log_ratio + log_prior - posterior.evidence.log_mean
    return Candidates(hands.to("cpu"), log_posterior.cpu(), probability.cpu(), steady=steady.cpu())
