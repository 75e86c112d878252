"""Reliability of probabilities that are right, too sure or too timid; AUC and Brier by hand; ensemble spread."""

import numpy as np
import pytest

from bayesgrasp.diagnostics.reliability import auc, ensemble_spread, reliability
from bayesgrasp.errors import InvalidConfigurationError


def outcomes(n: int = 20000) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    probability = rng.beta(0.5, 1.5, n)
    return probability, (rng.random(n) < probability).astype(float)


def sharpened(probability: np.ndarray, power: float) -> np.ndarray:
    """Log-odds times a power: above 1 too sure, below 1 too timid."""
    odds = (probability / (1 - probability)) ** power
    return odds / (1 + odds)


def test_right_probabilities_are_reliable() -> None:
    result = reliability(*outcomes())
    assert result.ece < 0.01
    assert abs(result.signed_error) < 0.01
    filled = [i for i, share in enumerate(result.share) if share > 0.02]
    assert max(abs(result.predicted[i] - result.observed[i]) for i in filled) < 0.05


def test_too_sure_and_too_timid_bend_the_curve_in_opposite_ways() -> None:
    probability, success = outcomes()
    sure, timid = (reliability(sharpened(probability, power), success) for power in (2.0, 0.5))
    assert min(sure.ece, timid.ece) > 0.04
    assert sure.observed[9] < sure.predicted[9]
    assert sure.observed[1] > sure.predicted[1]
    assert timid.observed[7] > timid.predicted[7]
    assert min(sure.brier, timid.brier) > reliability(probability, success).brier


def test_a_promise_of_too_much_is_positive() -> None:
    probability, success = outcomes()
    assert reliability(np.minimum(probability + 0.2, 1.0), success).signed_error > 0.1
    assert reliability(0.5 * probability, success).signed_error < -0.05


def test_weights_undo_a_selection() -> None:
    """Keep one failure in four and weigh it by four: the numbers of the whole set come back."""
    probability, success = outcomes(40000)
    kept = (success == 1) | (np.arange(len(success)) % 4 == 0)
    weight = np.where(success == 1, 1.0, 4.0)[kept]
    whole = reliability(probability, success)
    part = reliability(probability[kept], success[kept], weight)
    np.testing.assert_allclose([part.ece, part.brier, part.auc], [whole.ece, whole.brier, whole.auc], atol=0.01)
    assert reliability(probability[kept], success[kept]).ece > 0.1


def test_auc_and_brier_by_hand() -> None:
    score, success = np.array([0.1, 0.4, 0.4, 0.8]), np.array([0.0, 1.0, 0.0, 1.0])
    assert auc(score, success) == pytest.approx((2 + 1.5) / 4)
    assert reliability(score, success).brier == pytest.approx((0.01 + 0.36 + 0.16 + 0.04) / 4)
    assert auc(score, success, np.array([1.0, 1.0, 3.0, 1.0])) == pytest.approx((1 + 1.5 + 4) / 8)


def test_one_outcome_only_has_no_auc() -> None:
    result = reliability(np.array([0.2, 0.3]), np.zeros(2))
    assert np.isnan(result.auc)
    assert result.to_dict()["auc"] is None


def test_ensemble_spread_is_the_deviation_between_members() -> None:
    values = np.log(np.array([[0.5, 0.9], [0.5, 0.1]]))
    np.testing.assert_allclose(ensemble_spread(values), [0.0, np.log(9) / np.sqrt(2)])
    with pytest.raises(InvalidConfigurationError, match="two members"):
        ensemble_spread(values[:1])


def test_bad_input_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match=r"\[0, 1\]"):
        reliability(np.array([1.2]), np.ones(1))
    with pytest.raises(InvalidConfigurationError, match="positive sum"):
        reliability(np.array([0.2]), np.ones(1), np.zeros(1))
