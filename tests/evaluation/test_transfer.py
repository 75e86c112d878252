"""Losses are paired, by strategy and shift."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bayesgrasp.diagnostics.intervals import paired_difference
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.figures import plot_transfer
from bayesgrasp.evaluation.journal import SceneResult
from bayesgrasp.evaluation.transfer import markdown_transfer, summarize_transfer

Make = Callable[..., SceneResult]


@pytest.fixture(scope="module")
def results(result: Make) -> dict[str, list[SceneResult]]:
    """Ten scenes: the plan succeeds in all but one; in the other engine two of these fail and that one succeeds."""
    before = ["dropped", *["success"] * 9]
    after = ["success", "dropped", "no_contact", *["success"] * 7]
    return {
        name: [result(number, {"plan": outcome, "prior_sample": "collision"}) for number, outcome in enumerate(column)]
        for name, column in (("none", before), ("pybullet", after))
    }


def test_losses_are_paired(results: dict[str, list[SceneResult]]) -> None:
    summary = summarize_transfer(results)
    entry = summary["strategies"]["plan"]["pybullet"]
    assert entry["success_rate"] == pytest.approx(0.8)
    lost = entry["success_lost"]
    assert (lost["difference"], lost["broken"], lost["mended"]) == (pytest.approx(0.1), 2, 1)
    before, after = np.arange(10) > 0, ~np.isin(np.arange(10), (1, 2))
    assert lost["interval"] == pytest.approx(paired_difference(before, after)[1])
    assert entry["same_grasp"] == 10
    # Only even scenes hold: 2, 4, 6, 8 before; 0, 4, 6, 8 after.
    assert entry["hold_rate"] == pytest.approx(0.4)
    held = entry["hold_lost"]
    assert (held["difference"], held["broken"], held["mended"]) == (0.0, 1, 1)
    assert summary["strategies"]["plan"]["none"]["success_lost"]["difference"] == 0.0
    assert json.loads(json.dumps(summary)) == summary


def test_the_table_has_a_row_for_each_strategy_and_shift(results: dict[str, list[SceneResult]]) -> None:
    text = markdown_transfer(summarize_transfer(results))
    assert "| `plan` | none | 90.0 % | - | - | 40.0 % | - | - | 10 |" in text
    assert "| `plan` | pybullet | 80.0 % | **+10.0** |" in text
    assert len(text.splitlines()) == 6


def test_the_figure_shows_something(results: dict[str, list[SceneResult]], tmp_path: Path) -> None:
    plot_transfer(summarize_transfer(results), tmp_path / "transfer.png")
    assert np.asarray(Image.open(tmp_path / "transfer.png")).std() > 10


def test_unpaired_results_are_refused(results: dict[str, list[SceneResult]]) -> None:
    with pytest.raises(InvalidConfigurationError, match="same scenes"):
        summarize_transfer({"pybullet": results["pybullet"]})
    with pytest.raises(InvalidConfigurationError, match="same scenes"):
        summarize_transfer({**results, "pybullet": results["pybullet"][1:]})
