"""SBC and TARP: uniform ranks for an exact posterior; the spread and the shift tell how another one is wrong."""

import math

import known
import numpy as np
import pytest
import torch

from bayesgrasp.diagnostics.sbc import sbc_ranks, simulation_based_calibration, statistics
from bayesgrasp.diagnostics.tarp import tarp_ranks
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.geometry.grasp_space import GraspSpace
from bayesgrasp.types import Hands

CONTINUOUS = ("x", "y", "z", "yaw")


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


@pytest.fixture(scope="module")
def calibrations() -> dict[str, dict[str, object]]:
    result = {}
    for name, spread in known.SPREADS.items():
        truth, draws, _, _ = known.draw(spread)
        result[name] = simulation_based_calibration(truth, draws, rng())
    return result  # type: ignore[return-value]


@pytest.mark.parametrize("statistic", [*CONTINUOUS, "approach_angle", "type"])
def test_ranks_of_an_exact_posterior_are_uniform(calibrations: dict, statistic: str) -> None:
    ranks = calibrations["exact"][statistic]
    assert ranks.p_value > 0.01
    assert abs(ranks.spread - 1) < 0.08


@pytest.mark.parametrize("statistic", CONTINUOUS)
def test_spread_tells_wide_from_narrow(calibrations: dict, statistic: str) -> None:
    assert calibrations["wide"][statistic].spread < 0.85
    assert calibrations["narrow"][statistic].spread > 1.15
    assert max(calibrations[name][statistic].p_value for name in ("wide", "narrow")) < 1e-3


def test_a_bias_shifts_the_ranks() -> None:
    truth, draws, _, _ = known.draw(1.0)
    moved = Hands(truth.position + 0.02, truth.rotation, truth.grasp_type)
    ranks = simulation_based_calibration(moved, draws, rng())
    assert ranks["x"].shift > 0.15
    assert ranks["x"].p_value < 1e-6
    assert abs(ranks["yaw"].shift) < 0.05


def test_ties_are_ordered_at_random() -> None:
    ranks = sbc_ranks(np.zeros(2000), np.zeros((2000, 9)), rng())
    assert set(ranks.ranks) == set(range(10))
    assert ranks.histogram().min() > 140


def test_statistics_of_known_hands() -> None:
    """A hand straight down has approach angle 0; turned by yaw about the vertical, its closing direction turns."""
    down = torch.tensor([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    turns = torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 0.7], [0.3, 0.0, 0.0]])
    hands = Hands(torch.zeros(3, 3), so3.exp(turns) @ down, torch.tensor([0, 1, 2]))
    values = statistics(hands)
    np.testing.assert_allclose(values["approach_angle"], [0.0, 0.0, 0.3], atol=1e-3)
    np.testing.assert_allclose(values["yaw"][1] - values["yaw"][0], 0.7, atol=1e-6)
    assert values["type"].tolist() == [0, 1, 2]


@pytest.fixture(scope="module")
def references() -> Hands:
    generator = np.random.default_rng(1)
    position = torch.from_numpy(generator.uniform(-0.15, 0.15, (known.TRUTHS, 3)))
    rotation = so3.random_rotation(known.TRUTHS, generator, torch.float64)
    return Hands(position, rotation, torch.from_numpy(generator.integers(0, 3, known.TRUTHS)))


def test_tarp_is_uniform_for_the_exact_posterior_only(references: Hands) -> None:
    space, result = GraspSpace(), {}
    for name, spread in known.SPREADS.items():
        truth, draws, _, _ = known.draw(spread)
        result[name] = tarp_ranks(truth, draws, references, space.distance, rng())
    assert result["exact"].p_value > 0.01
    assert result["wide"].spread < 0.9
    assert result["narrow"].spread > 1.1
    assert max(result["wide"].p_value, result["narrow"].p_value) < 1e-3


def test_tarp_refuses_shapes_that_do_not_belong_together(references: Hands) -> None:
    truth, draws, _, _ = known.draw(1.0)
    with pytest.raises(InvalidConfigurationError, match="TARP needs shapes"):
        tarp_ranks(truth, draws, references[:5], GraspSpace().distance, rng())


def test_no_draws_are_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="at least one posterior draw"):
        sbc_ranks(np.zeros(2), np.zeros((2, 0)), rng())


def test_report_is_plain_data() -> None:
    report = sbc_ranks(np.zeros(10), np.ones((10, 4)), rng()).to_dict()
    assert report["count"] == 10
    assert report["histogram"] == [0, 10, 0, 0, 0, 0, 0, 0, 0, 0]
    assert math.isclose(report["shift"], -0.4)  # type: ignore[arg-type]
