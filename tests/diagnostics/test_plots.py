"""Figures are written, and matplotlib's global state is left alone."""

from pathlib import Path

import known
import matplotlib as mpl
import numpy as np

from bayesgrasp.diagnostics.coverage import expected_coverage, hpd_mass
from bayesgrasp.diagnostics.plots import plot_coverage, plot_ranks, plot_reliability, plot_spread
from bayesgrasp.diagnostics.reliability import reliability
from bayesgrasp.diagnostics.sbc import simulation_based_calibration

PNG = b"\x89PNG"


def test_every_figure_is_written(tmp_path: Path) -> None:
    before = dict(mpl.rcParams)
    truth, draws, log_truth, log_draws = known.draw(1.0)
    curve = expected_coverage(hpd_mass(log_truth, log_draws))
    plot_coverage({"exact": curve}, tmp_path / "new" / "coverage.png")
    plot_ranks(simulation_based_calibration(truth, draws, np.random.default_rng(0)), tmp_path / "sbc.png")
    score = np.random.default_rng(1).random(500)
    plot_reliability(reliability(score, (score > 0.5).astype(float)), tmp_path / "reliability.png")
    plot_spread(score, tmp_path / "spread.png")
    names = ("new/coverage.png", "sbc.png", "reliability.png", "spread.png")
    assert all((tmp_path / name).read_bytes()[:4] == PNG for name in names)
    assert dict(mpl.rcParams) == before
