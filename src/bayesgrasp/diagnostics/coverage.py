"""Expected coverage of highest-density regions (Hermans et al. 2022), over all of h = (x, R, g) at once.

The smallest highest-posterior-density region that contains the truth h* holds the posterior mass

    alpha* = P(p(h | S=1, i) > p(h* | S=1, i)),    h ~ p(h | S=1, i).

If the posterior is right, alpha* is uniform, and a region of credibility 1 - alpha contains the truth that often.
Above the diagonal the posterior is too wide (conservative), below it too narrow (overconfident). Only log-densities up
to a constant are needed: of the truth, and of draws from the posterior (or of weighted draws from any proposal).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from bayesgrasp.errors import InvalidConfigurationError

LEVELS = tuple(np.round(np.arange(1, 20) * 0.05, 2).tolist())


@dataclass(frozen=True)
class Coverage:
    """Observed coverage by credibility level.

    Attributes:
        levels: Credibilities.
        coverage: Share of truths inside the region of that credibility.
        count: Number of truths.
    """

    levels: tuple[float, ...]
    coverage: tuple[float, ...]
    count: int

    @property
    def max_error(self) -> float:
        """Largest distance from the diagonal."""
        return float(np.abs(np.subtract(self.coverage, self.levels)).max())

    @property
    def mean_signed_error(self) -> float:
        """Mean of coverage minus level: positive for a posterior that is too wide, negative for one too narrow."""
        return float(np.subtract(self.coverage, self.levels).mean())

    def to_dict(self) -> dict[str, object]:
        """As JSON-able data."""
        return {
            "levels": list(self.levels),
            "coverage": list(self.coverage),
            "max_error": self.max_error,
            "mean_signed_error": self.mean_signed_error,
            "count": self.count,
        }


def hpd_mass(
    truth: Float[np.ndarray, "n"], draws: Float[np.ndarray, "n m"], weights: Float[np.ndarray, "n m"] | None = None
) -> Float[np.ndarray, "n"]:
    """Mass alpha* of the smallest highest-density region that contains each truth.

    Args:
        truth: Log-densities of the truths, up to a constant per row.
        draws: Log-densities of posterior draws for the same observation, up to the same constant.
        weights: Importance weights of the draws, where they do not come from the posterior; need not sum to 1.

    Raises:
        InvalidConfigurationError: No draws, or log-densities that are NaN.
    """
    if draws.size == 0 or np.isnan(truth).any() or np.isnan(draws).any():
        raise InvalidConfigurationError("coverage needs at least one truth, at least one draw each, and no NaN")
    weights = np.ones_like(draws) if weights is None else weights
    # A draw at the very density of the truth is on the border of the region: half inside.
    above = (draws > truth[:, None]) + 0.5 * (draws == truth[:, None])
    shares: Float[np.ndarray, "n"] = (above * weights).sum(-1) / weights.sum(-1)
    return shares


def expected_coverage(mass: Float[np.ndarray, "n"], levels: tuple[float, ...] = LEVELS) -> Coverage:
    """Share of truths inside the region of each credibility, given `hpd_mass` (or TARP's) for each truth.

    Raises:
        InvalidConfigurationError: No truths, or a level outside (0, 1).
    """
    if len(mass) == 0 or not all(0 < level < 1 for level in levels):
        raise InvalidConfigurationError("coverage needs at least one truth, and levels strictly between 0 and 1")
    observed = tuple(float((mass <= level).mean()) for level in levels)
    return Coverage(tuple(levels), observed, len(mass))
