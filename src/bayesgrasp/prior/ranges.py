"""Intervals of uniform priors: checking them, and drawing float32 numbers that stay inside."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float32

from bayesgrasp.errors import InvalidConfigurationError

Interval = tuple[float, float]


def check_interval(name: str, interval: Interval, minimum: float = -math.inf) -> None:
    """Refuse an interval that is not finite, is reversed, or starts below `minimum`.

    Raises:
        InvalidConfigurationError: Naming the parameter and what would be valid.
    """
    low, high = interval
    if not (math.isfinite(low) and math.isfinite(high) and minimum <= low <= high):
        above = f" and {minimum} <= low" if minimum > -math.inf else ""
        raise InvalidConfigurationError(f"{name} must be (low, high), finite, with low <= high{above}; got {interval}")


def uniform(rng: np.random.Generator, interval: Interval, n: int) -> Float32[np.ndarray, "{n}"]:
    """Uniform draws, rounded to float32 without leaving the interval."""
    low, high = interval
    draws = rng.uniform(low, high, n).astype(np.float32)
    return np.clip(draws, *_inside(low, high))


def _inside(low: float, high: float) -> tuple[np.float32, np.float32]:
    """The outermost float32 numbers within [low, high]; the nearest ones if the interval holds none."""
    lowest, highest = np.float32(low), np.float32(high)
    if float(lowest) < low:
        lowest = np.nextafter(lowest, np.float32(np.inf))
    if float(highest) > high:
        highest = np.nextafter(highest, np.float32(-np.inf))
    return (lowest, highest) if lowest <= highest else (np.float32(low), np.float32(low))
