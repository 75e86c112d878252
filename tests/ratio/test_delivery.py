"""What plans delivered on fresh objects, and what may be promised because of it."""

import json

import numpy as np
import pytest

from bayesgrasp.errors import CheckpointError, InvalidConfigurationError
from bayesgrasp.ratio.delivery import DOUBT, Delivery, fit_beta
from bayesgrasp.seeding import generator


def plans(count: int, seed: int, rate=lambda p: p) -> Delivery:
    """Plans whose grasps succeed at a rate that depends on their promise."""
    rng = generator(seed)
    promised = rng.beta(3, 1, count)
    return Delivery(promised, rng.random(count) < rate(promised), "made up", ("0" * 64,))


def test_an_overconfident_model_is_brought_down() -> None:
    """True rate = promise^2, far from what a power of the odds gives."""
    calibration = plans(20_000, 0, np.square).calibration
    p = np.linspace(0.4, 0.99, 20)
    np.testing.assert_allclose(calibration.of(p), p**2, atol=0.03)


def test_the_order_of_promises_stays() -> None:
    """Even where more was delivered for less."""
    calibration = plans(500, 1, lambda p: 1 - p).calibration
    assert (np.diff(calibration.of(np.linspace(0, 1, 200))) >= 0).all()


def test_a_calibrated_model_is_left_about_as_it_is() -> None:
    calibration = plans(20_000, 2).calibration
    p = np.linspace(0.3, 0.99, 20)
    np.testing.assert_allclose(calibration.of(p), p, atol=0.03)
    assert np.isnan(calibration.of(np.array([np.nan]))).all()


def test_the_fit_maximises_the_likelihood() -> None:
    delivery = plans(800, 3, np.square)

    def deviance(calibration) -> float:
        q = calibration.of(delivery.promised)
        return float(-np.where(delivery.success, np.log(q), np.log1p(-q)).sum())

    best = fit_beta(delivery.promised, delivery.success)
    for name in ("a", "b", "c"):
        for step in (-0.05, 0.05):
            moved = type(best)(**{**vars(best), name: max(getattr(best, name) + step, 0.0)})
            assert deviance(moved) > deviance(best) - 0.01


def test_what_passes_the_least_promise_succeeds_at_the_wanted_rate() -> None:
    """Over many calibrations at most a tenth of the thresholds deliver less; enough others are not refused."""
    wanted, broken, given = 0.8, 0, 0
    for seed in range(120):
        delivery = plans(600, 100 + seed, np.square)
        least = delivery.least_promise(wanted)
        if least is None:
            continue
        given += 1
        fresh = plans(20_000, 500, np.square)
        kept = delivery.calibration.of(fresh.promised) >= least - 1e-12
        broken += bool(np.square(fresh.promised[kept]).mean() < wanted)
    assert given > 100
    assert broken / given <= DOUBT + 2 * np.sqrt(DOUBT * (1 - DOUBT) / given)
    assert broken > 0, "a threshold that never breaks refuses too much"


def test_more_confidence_needs_a_higher_promise() -> None:
    delivery = plans(2000, 4)
    promises = [delivery.least_promise(wanted) for wanted in (0.7, 0.9, 0.95)]
    assert all(promise is not None for promise in promises)
    assert promises == sorted(promises)


def test_a_confidence_that_the_plans_cannot_show_is_not_given() -> None:
    assert plans(300, 5).least_promise(0.999) is None
    assert plans(300, 5, lambda p: 0 * p).least_promise(0.6) is None
    with pytest.raises(InvalidConfigurationError, match="between 0 and 1"):
        plans(300, 5).least_promise(1.0)


def test_a_card_keeps_it() -> None:
    delivery = plans(300, 6)
    again = Delivery.from_dict(json.loads(json.dumps(delivery.to_dict())))
    np.testing.assert_allclose(again.promised, delivery.promised, atol=1e-6)
    assert (again.success == delivery.success).all()
    assert (again.objects, again.weights) == (delivery.objects, delivery.weights)


@pytest.mark.parametrize(
    "change",
    [
        {"promised": [0.5] * 99},
        {"promised": "0.5"},
        {"promised": [2.0] * 300},
        {"success": [0.5] * 300},
        {"objects": 3},
        {"weights": [1]},
        {"weights": None},
    ],
)
def test_damaged_ones_are_refused(change) -> None:
    with pytest.raises(CheckpointError, match="delivered"):
        Delivery.from_dict(plans(300, 7).to_dict() | change)
    with pytest.raises(CheckpointError):
        Delivery.from_dict({})
