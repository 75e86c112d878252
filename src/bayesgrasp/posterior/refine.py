"""Search for maxima without gradients: random trials around the best hands so far, ever closer, for ever fewer of them.

The log-ratio of a trained network is rough: it is piecewise bilinear in the image, and jumps in depth are steep. Close
to a maximum its gradient says little about where the maximum is, and an ascent stops short of it. Values cost a third
of what gradients cost, and many at once cost little more than a few. So, from each start, in rounds k = 1, 2, ...

    h' = (clip(x + s_k l e_x), R exp(s_k [e_w]_x)),   e ~ N(0, I_6);    h <- the best of h and its trials,

a (1 + lambda) evolution strategy (Rechenberg 1973) whose steps s_k shrink by a fixed schedule, with successive halving
(Jamieson & Talwalkar 2016): all trials of a round are shared out among the starts still in the race, the fewer the
later. Starts that drop out keep what they have found: a robot may need a hand of another kind than the best.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.grasp_space import GraspSpace
from bayesgrasp.posterior.potential import Potential
from bayesgrasp.types import Hands


@dataclass(frozen=True)
class RefineConfig:
    """How to refine starts.

    Attributes:
        steps: Standard deviation of the trials of each round along each axis, radians in the metric `space`.
        kept: How many starts of each group are in each round, at most; not increasing.
        trials: Of a round, over all starts.
        space: The metric.

    Raises:
        InvalidConfigurationError: Not one positive number for each round, or more starts in a later round.
    """

    steps: tuple[float, ...] = (0.25, 0.2, 0.15, 0.12, 0.09, 0.07, 0.05, 0.03)
    kept: tuple[int, ...] = (12, 10, 8, 6, 4, 3, 2, 2)
    trials: int = 448
    space: GraspSpace = field(default_factory=GraspSpace)

    def __post_init__(self) -> None:
        if not self.steps or len(self.steps) != len(self.kept) or min(*self.steps, *self.kept, self.trials) <= 0:
            raise InvalidConfigurationError(f"need a positive step and number of starts for each round, got {self}")
        if any(later > earlier for earlier, later in pairwise(self.kept)):
            raise InvalidConfigurationError(f"a start that dropped out does not come back, got {self.kept}")


def refine(
    potential: Potential,
    starts: Hands,
    group: Int[Tensor, "n"],
    rng: np.random.Generator,
    config: RefineConfig | None = None,
) -> Hands:
    """Hands (n,) with a potential no higher than that of the starts, in another order.

    Args:
        potential: What is to be minimised; it may have a weight for each row of the starts.
        starts: Batch shape (n,).
        group: Starts compete within their group only.
        rng: Source of the trials.
        config: The schedule.
    """
    config = config or RefineConfig()
    race = _Race(potential, starts, potential.value(starts), group)
    ends: list[Hands] = []
    for step, kept in zip(config.steps, config.kept, strict=True):
        race, out = race.halve(kept)
        ends.append(out)
        race = race.advance(step, config, rng)
    return Hands.cat([race.hands, *reversed(ends)])


@dataclass(frozen=True)
class _Race:
    """Starts that are still in the race, and what they have reached."""

    potential: Potential
    hands: Hands
    value: Float[Tensor, "n"]
    group: Int[Tensor, "n"]

    def halve(self, kept: int) -> tuple[_Race, Hands]:
        """The best of each group, best first, and the hands of those that drop out."""
        order = self.value.argsort()
        group = self.group[order]
        # The place of each in its own group: how many of the same group stand before it.
        same = group == group[:, None]
        stays = same.tril().sum(-1) <= kept
        return self._of(order[stays]), self.hands[order[~stays]]

    def _of(self, rows: Int[Tensor, "m"]) -> _Race:
        return _Race(self.potential.of(rows), self.hands[rows], self.value[rows], self.group[rows])

    def advance(self, step: float, config: RefineConfig, rng: np.random.Generator) -> _Race:
        """Each start at the best of itself and its trials."""
        count = len(self.value)
        each = max(1, config.trials // max(count, 1))
        origin = torch.arange(count, device=self.value.device).repeat_interleave(each)
        length = config.space.per_radian(self.value)
        noise = torch.from_numpy(rng.standard_normal((len(origin), 6), np.float32)).to(self.value)
        trial = config.space.retract(self.hands[origin], step * length * noise)
        trial = replace(trial, position=self.potential.box.clip(trial.position))
        best = self.potential.of(origin).value(trial).view(count, each).min(-1)
        better = best.values < self.value
        # Starts stand before the trials, so the row of what each goes on with can be told by one index.
        every, first = Hands.cat([self.hands, trial]), torch.arange(count, device=self.value.device)
        rows = torch.where(better, count + each * first + best.indices, first)
        return replace(self, hands=every[rows], value=torch.minimum(best.values, self.value))
