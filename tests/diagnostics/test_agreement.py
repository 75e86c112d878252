"""Cohen's kappa: a published example, its ends, and the interval's coverage."""

import numpy as np
import pytest

from bayesgrasp.diagnostics.agreement import cohens_kappa, confusion
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.seeding import generator


def test_confusion_counts_pairs() -> None:
    table = confusion(np.array([0, 1, 1, 2]), np.array([0, 1, 2, 2]), 3)
    np.testing.assert_array_equal(table, [[1, 0, 0], [0, 1, 1], [0, 0, 1]])


def test_kappa_by_hand() -> None:
    # p_o = 0.7, p_e = 0.5 * 0.6 + 0.5 * 0.4 = 0.5.
    kappa, (low, high) = cohens_kappa(np.array([[20, 5], [10, 15]]))
    assert kappa == pytest.approx(0.4)
    assert low < 0.4 < high


def test_perfect_and_chance_agreement() -> None:
    assert cohens_kappa(np.diag([5, 7]))[0] == pytest.approx(1.0)
    assert cohens_kappa(np.array([[25, 25], [25, 25]]))[0] == pytest.approx(0.0)


def test_the_interval_covers_the_truth_as_often_as_it_says() -> None:
    share = np.array([[0.05, 0.02], [0.03, 0.90]])
    truth = cohens_kappa((share * 10000).round().astype(np.int64))[0]
    rng = generator(3, 0)
    covered = 0
    for _ in range(400):
        low, high = cohens_kappa(rng.multinomial(1000, share.ravel()).reshape(2, 2))[1]
        covered += low <= truth <= high
    assert 0.91 <= covered / 400 <= 0.98


def test_what_has_no_kappa_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError):
        cohens_kappa(np.zeros((2, 2), np.int64))
    with pytest.raises(InvalidConfigurationError):
        cohens_kappa(np.array([[9, 0], [0, 0]]))
    with pytest.raises(InvalidConfigurationError):
        confusion(np.array([0, 3]), np.array([0, 1]), 2)
    with pytest.raises(InvalidConfigurationError):
        confusion(np.array([0]), np.array([0, 1]), 2)
