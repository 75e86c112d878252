"""Coverage lands on the diagonal for an exact posterior, above it for a wide one, below it for a narrow one."""

import known
import numpy as np
import pytest

from bayesgrasp.diagnostics.coverage import expected_coverage, hpd_mass
from bayesgrasp.errors import InvalidConfigurationError


def coverage(name: str) -> np.ndarray:
    _, _, truth, draws = known.draw(known.SPREADS[name])
    return np.subtract(*(getattr(expected_coverage(hpd_mass(truth, draws)), f) for f in ("coverage", "levels")))


def test_an_exact_posterior_lies_on_the_diagonal() -> None:
    # Three standard deviations of a binomial share at 500 truths, in the middle.
    assert np.abs(coverage("exact")).max() < 3 * np.sqrt(0.25 / known.TRUTHS)


def test_a_wide_posterior_lies_above_and_a_narrow_one_below() -> None:
    assert coverage("wide").min() > -0.01
    assert coverage("wide").max() > 0.2
    assert coverage("narrow").max() < 0.01
    assert coverage("narrow").min() < -0.2


def test_signed_error_names_the_direction() -> None:
    results = {}
    for name, spread in known.SPREADS.items():
        _, _, truth, draws = known.draw(spread)
        results[name] = expected_coverage(hpd_mass(truth, draws)).mean_signed_error
    assert results["narrow"] < -0.1
    assert abs(results["exact"]) < 0.03
    assert results["wide"] > 0.1


def test_weighted_draws_stand_for_the_posterior() -> None:
    """Draws from the wide posterior, weighted to the exact one, give the exact coverage."""
    _, _, truth, _ = known.draw(1.0)
    _, _, _, wide = known.draw(1.6)
    square = -2 * wide * 1.6**2
    exact = -0.5 * square
    result = expected_coverage(hpd_mass(truth, exact, np.exp(exact - wide)))
    assert result.max_error < 3 * np.sqrt(0.25 / known.TRUTHS)
    assert expected_coverage(hpd_mass(truth, exact)).max_error > 0.1


def test_mass_by_hand() -> None:
    truth, draws = np.array([2.0, 0.0]), np.array([[1.0, 3.0, 4.0, 2.0], [0.0, 0.0, 0.0, 0.0]])
    np.testing.assert_allclose(hpd_mass(truth, draws), [2.5 / 4, 0.5])
    weights = np.array([[1.0, 1.0, 2.0, 0.0]] * 2)
    np.testing.assert_allclose(hpd_mass(truth, draws, weights), [3 / 4, 0.5])


def test_report_has_the_levels_and_the_largest_error() -> None:
    result = expected_coverage(np.array([0.1, 0.4, 0.8]), (0.25, 0.5))
    assert result.to_dict() == {
        "levels": [0.25, 0.5],
        "coverage": [1 / 3, 2 / 3],
        "max_error": pytest.approx(1 / 6),
        "mean_signed_error": pytest.approx((1 / 12 + 1 / 6) / 2),
        "count": 3,
    }


def test_bad_input_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="NaN"):
        hpd_mass(np.array([np.nan]), np.ones((1, 2)))
    with pytest.raises(InvalidConfigurationError, match="at least one draw"):
        hpd_mass(np.ones(1), np.ones((1, 0)))
    with pytest.raises(InvalidConfigurationError, match="between 0 and 1"):
        expected_coverage(np.ones(3), (0.5, 1.0))
