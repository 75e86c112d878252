"""Intervals of success rates (Wilson 1927): sensible also near 0 and 1, where our rates are."""

from scipy.stats import binomtest

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
