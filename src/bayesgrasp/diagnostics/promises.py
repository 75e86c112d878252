"""Does a plan keep its promise? The success that grasps promised beside what they delivered, and what refusal buys.

Pairs of a promise p and an outcome S, one for each plan, sorted by p: in each fifth the mean of p against the share of
S; the area under the ROC curve of 1 - p for failures; and the risk-coverage curve (El-Yaniv and Wiener 2010), the share
of failures among the plans that promise most, over the share of plans that are kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Float64
from matplotlib.figure import Figure

from bayesgrasp.diagnostics.intervals import wilson
from bayesgrasp.diagnostics.reliability import auc
from bayesgrasp.errors import InvalidConfigurationError

PARTS = 5
"""Parts of equal size that the plans are sorted into by their promise."""


@dataclass(frozen=True)
class Part:
    """Plans of similar promises.

    Attributes:
        promised: Mean promise.
        delivered: Share of successes.
        interval: Its Wilson interval at 95 %.
        count: Plans.
    """

    promised: float
    delivered: float
    interval: tuple[float, float]
    count: int


@dataclass(frozen=True)
class Promises:
    """Promises beside outcomes.

    Attributes:
        overall: All plans.
        parts: By promise, the lowest first.
        auc: Probability that a failure promised less than a success; NaN without both.
        coverage, risk: The risk-coverage curve: shares of plans kept, the highest promises first, and of failures.
    """

    overall: Part
    parts: tuple[Part, ...]
    auc: float
    coverage: Float64[np.ndarray, "n"]
    risk: Float64[np.ndarray, "n"]

    def to_dict(self) -> dict[str, Any]:
        """As JSON-able data, without the curve."""
        return {
            **vars(self.overall),
            "auc": self.auc if np.isfinite(self.auc) else None,
            "fifths": [vars(part) for part in self.parts],
        }

    def __str__(self) -> str:
        overall, (low, high) = self.overall, self.overall.interval
        worst = max(self.parts, key=lambda part: abs(part.promised - part.delivered))
        return (
            f"{overall.count} plans promised {100 * overall.promised:.1f} % and delivered "
            f"{100 * overall.delivered:.1f} % ({100 * low:.1f} - {100 * high:.1f}); "
            f"worst fifth {100 * worst.promised:.1f} against {100 * worst.delivered:.1f} %; "
            f"AUC of failure {self.auc:.2f}"
        )

    def draw(self) -> Figure:
        """Reliability by fifths, and the risk-coverage curve."""
        figure = Figure(figsize=(9, 4), layout="constrained")
        kept, curve = figure.subplots(1, 2)
        values = np.array([[part.promised, part.delivered, *part.interval] for part in self.parts])
        errors = np.abs(values[:, 2:].T - values[:, 1])
        kept.errorbar(values[:, 0], values[:, 1], errors, fmt="o", capsize=3)
        lowest = min(values[:, :3].min() - 0.02, 0.9)
        kept.plot([lowest, 1], [lowest, 1], color="0.6", linewidth=1)
        kept.set(xlabel="promised", ylabel="delivered", title=f"fifths of {self.overall.count} plans, 95 % intervals")
        curve.plot(self.coverage, self.risk)
        curve.set(xlabel="share of plans kept, highest promise first", ylabel="share of failures", xlim=(0, 1))
        curve.set(ylim=(0, None), title="risk by coverage")
        return figure


def keep_promises(promised: Float[np.ndarray, "n"], success: Bool[np.ndarray, "n"]) -> Promises:
    """Compare promises with outcomes.

    Args:
        promised: p(S=1 | i, h) of each plan's grasp.
        success: S.

    Raises:
        InvalidConfigurationError: Fewer than five plans, or promises that are not in [0, 1].
    """
    promised, success = np.asarray(promised, dtype=np.float64), np.asarray(success, dtype=bool)
    if len(promised) < PARTS or not ((promised >= 0) & (promised <= 1)).all():
        raise InvalidConfigurationError(f"need at least {PARTS} plans with promises between 0 and 1")
    order = np.argsort(promised, kind="stable")
    parts = tuple(_part(promised[rows], success[rows]) for rows in np.array_split(order, PARTS))
    number = np.arange(1, len(order) + 1)
    risk = np.cumsum(~success[order[::-1]]) / number
    area = auc(promised, success.astype(np.float64))
    return Promises(_part(promised, success), parts, area, number / len(order), risk)


def _part(promised: Float64[np.ndarray, "n"], success: Bool[np.ndarray, "n"]) -> Part:
    interval = wilson(int(success.sum()), len(success))
    return Part(float(promised.mean()), float(success.mean()), interval, len(success))
