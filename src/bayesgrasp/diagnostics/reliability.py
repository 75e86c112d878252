"""Does p(S = 1 | i, h) = 0.7 succeed in 70 % of simulations? Calibration and discrimination of a success probability.

    ECE    sum over bins of (share of the bin) |mean S - mean p|      (Guo et al. 2017)
    Brier  mean (p - S)^2
    AUC    P(p of a success > p of a failure), ties count half

Weights make a sample from another distribution stand for the prior. The ensemble spread is the disagreement of
independently trained estimators, which grows where the training data says little.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import stats

from bayesgrasp.errors import InvalidConfigurationError


@dataclass(frozen=True)
class Reliability:
    """Calibration of a success probability.

    Attributes:
        predicted, observed: Mean probability and share of successes by bin; NaN where a bin is empty.
        share: Weight of each bin.
        ece, brier, auc: See the module; AUC is NaN where there are only successes or only failures.
        count: Number of attempts.
    """

    predicted: tuple[float, ...]
    observed: tuple[float, ...]
    share: tuple[float, ...]
    ece: float
    brier: float
    auc: float
    count: int

    @property
    def signed_error(self) -> float:
        """Mean prediction minus share of successes: positive where it promises too much."""
        filled = [i for i, share in enumerate(self.share) if share > 0]
        return float(sum(self.share[i] * (self.predicted[i] - self.observed[i]) for i in filled))

    def to_dict(self) -> dict[str, object]:
        """As JSON-able data; NaN becomes None."""
        lists = {name: [_finite(v) for v in getattr(self, name)] for name in ("predicted", "observed", "share")}
        numbers = {name: _finite(getattr(self, name)) for name in ("ece", "brier", "auc", "signed_error")}
        return {**numbers, **lists, "count": self.count}


def reliability(
    probability: Float[np.ndarray, "n"],
    success: Float[np.ndarray, "n"],
    weight: Float[np.ndarray, "n"] | None = None,
    bins: int = 10,
) -> Reliability:
    """Compare predicted probabilities with outcomes, in equal bins of [0, 1].

    Args:
        probability: Predicted p(S=1).
        success: S, 0 or 1.
        weight: Of each attempt; all equal if None.
        bins: Number of bins.

    Raises:
        InvalidConfigurationError: Nothing to compare, probabilities outside [0, 1], or no weight at all.
    """
    if len(probability) == 0 or not ((probability >= 0) & (probability <= 1)).all():
        raise InvalidConfigurationError("reliability needs at least one prediction, and probabilities in [0, 1]")
    weight = np.ones_like(probability) if weight is None else weight
    if not weight.sum() > 0:
        raise InvalidConfigurationError("reliability needs weights with a positive sum")
    weight = weight / weight.sum()
    # A probability of exactly 1 belongs to the last bin.
    index = np.minimum((probability * bins).astype(int), bins - 1)
    share, sums, hits = (np.bincount(index, weight * x, bins) for x in (np.ones_like(weight), probability, success))
    with np.errstate(invalid="ignore"):  # an empty bin has no mean: NaN
        predicted, observed = sums / share, hits / share
    ece = float(np.nansum(share * np.abs(predicted - observed)))
    brier = float((weight * (probability - success) ** 2).sum())
    area = auc(probability, success, weight)
    lists = [tuple(x.tolist()) for x in (predicted, observed, share)]
    return Reliability(lists[0], lists[1], lists[2], ece, brier, area, len(probability))


def auc(
    score: Float[np.ndarray, "n"], success: Float[np.ndarray, "n"], weight: Float[np.ndarray, "n"] | None = None
) -> float:
    """Weighted area under the ROC curve; NaN without both outcomes."""
    weight = np.ones_like(score) if weight is None else weight
    # One bin for each different score: its successes beat all failures of the bins below, and half of their own.
    ranks = stats.rankdata(score, "dense") - 1
    positive = np.bincount(ranks, weight * success)
    negative = np.bincount(ranks, weight * (1 - success))
    total = positive.sum() * negative.sum()
    below = np.cumsum(negative) - negative
    return float((positive * (below + 0.5 * negative)).sum() / total) if total > 0 else float("nan")


def ensemble_spread(log_probability: Float[np.ndarray, "members n"]) -> Float[np.ndarray, "n"]:
    """Standard deviation of log p(S=1 | i, h) between the members of an ensemble, nats.

    Raises:
        InvalidConfigurationError: Fewer than two members.
    """
    if len(log_probability) < 2:
        raise InvalidConfigurationError(f"the spread of an ensemble needs two members, got {len(log_probability)}")
    spread: Float[np.ndarray, "n"] = log_probability.std(0, ddof=1)
    return spread


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
