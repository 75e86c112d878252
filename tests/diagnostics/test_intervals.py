"""Intervals of paired differences: they cover, and keep a width where nothing differs."""

import numpy as np
import pytest

from bayesgrasp.diagnostics.intervals import paired_difference
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.seeding import generator


def test_the_difference_is_that_of_the_rates() -> None:
    first, second = np.array([True, True, True, False]), np.array([True, False, False, True])
    mean, (low, high) = paired_difference(first, second)
    assert mean == pytest.approx(first.mean() - second.mean())
    assert low < mean < high
    swapped, (other_low, other_high) = paired_difference(second, first)
    assert (swapped, other_low, other_high) == pytest.approx((-mean, -high, -low))


def test_agreement_leaves_a_width_that_shrinks() -> None:
    widths = []
    for n in (10, 100, 1000):
        mean, (low, high) = paired_difference(np.ones(n, bool), np.ones(n, bool))
        assert mean == 0
        widths.append(high - low)
    assert widths[0] > 5 * widths[1] > 25 * widths[2] > 0


@pytest.mark.parametrize(("before", "change"), [(0.95, 0.03), (0.6, 0.2)])
def test_intervals_cover(before: float, change: float) -> None:
    rng, n, runs = generator(0), 200, 2000
    first = rng.random((runs, n)) < before
    second = np.where(rng.random((runs, n)) < change, False, first)
    truth = before * change
    bounds = [paired_difference(a, b)[1] for a, b in zip(first, second, strict=True)]
    assert 0.94 < np.mean([low <= truth <= high for low, high in bounds]) < 0.99


def test_no_pairs_are_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="at least one pair"):
        paired_difference(np.zeros(0, bool), np.zeros(0, bool))
