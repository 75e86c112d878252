"""Intervals of success rates (Wilson 1927) and of their paired differences (Bonett and Price 2012).

Both are sensible also near 0 and 1, where our rates are.
"""

import numpy as np
from jaxtyping import Bool
from scipy.stats import binomtest, norm

from bayesgrasp.errors import InvalidConfigurationError


def wilson(successes: int, attempts: int, level: float = 0.95) -> tuple[float, float]:
    """The Wilson interval of a rate.

    Raises:
        InvalidConfigurationError: No attempts, or more successes than attempts.
    """
    if attempts < 1 or not 0 <= successes <= attempts:
        raise InvalidConfigurationError(f"a rate needs 0 <= successes <= attempts, got {successes} of {attempts}")
    interval = binomtest(successes, attempts).proportion_ci(level, method="wilson")
    return float(interval.low), float(interval.high)


def paired_difference(
    first: Bool[np.ndarray, "n"], second: Bool[np.ndarray, "n"], level: float = 0.95
) -> tuple[float, tuple[float, float]]:
    """How much more often the first of n pairs succeeds, and the interval of that difference.

    With f_12 and f_21 the shares of pairs in which only one of the two succeeds, each taken with one more pair
    (p = (n f + 1) / (n + 2)), the interval is p_12 - p_21 +- z sqrt((p_12 + p_21 - (p_12 - p_21)^2) / (n + 2))
    (Bonett and Price, "Adjusted Wald confidence interval for a difference of binomial proportions based on paired
    data", 2012). It keeps a width where no pair differs.

    Raises:
        InvalidConfigurationError: No pairs.
    """
    if len(first) == 0:
        raise InvalidConfigurationError("a paired difference needs at least one pair")
    n = len(first)
    one, other = int((first & ~second).sum()), int((second & ~first).sum())
    p, q = (one + 1) / (n + 2), (other + 1) / (n + 2)
    # The point estimate is the plain one; only the interval is about the shrunken shares.
    half = float(norm.ppf(0.5 + level / 2)) * float(np.sqrt((p + q - (p - q) ** 2) / (n + 2)))
    return (one - other) / n, (max(p - q - half, -1.0), min(p - q + half, 1.0))
