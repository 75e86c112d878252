"""Plots of the diagnostics, without any global state of matplotlib (Agg canvas, object interface)."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy import stats

from bayesgrasp.diagnostics.coverage import Coverage
from bayesgrasp.diagnostics.reliability import Reliability
from bayesgrasp.diagnostics.sbc import Ranks
from bayesgrasp.files import make_directory, write_through

GREY, BLUE, RED = "0.85", "tab:blue", "tab:red"
CONFIDENCE = 0.95


def plot_coverage(curves: Mapping[str, Coverage], path: Path) -> None:
    """Coverage against credibility, with the band in which 95 % of right posteriors would lie, level by level."""
    figure = Figure(figsize=(4.2, 4.0), layout="constrained")
    axes = figure.add_subplot(xlabel="credibility level", ylabel="expected coverage", xlim=(0, 1), ylim=(0, 1))
    # Whether a truth is inside is a coin toss of that level, so counts are binomial; the widest band is shown.
    count = min(curve.count for curve in curves.values())
    levels = np.linspace(0, 1, 101)
    low, high = (stats.binom.ppf(q, count, levels) / count for q in ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2))
    axes.fill_between(levels, low, high, color=GREY, label=f"right posterior, 95 %, n = {count}")
    axes.plot([0, 1], [0, 1], color="0.4", linewidth=0.8)
    for name, curve in curves.items():
        label = f"{name} (max. error {curve.max_error:.3f})"
        axes.plot((0, *curve.levels, 1), (0, *curve.coverage, 1), marker=".", label=label)
    axes.text(0.04, 0.72, "too wide", color="0.4")
    axes.text(0.72, 0.05, "too narrow", color="0.4")
    axes.set_aspect("equal")
    axes.legend(loc="upper left", fontsize=7)
    save(figure, path)


def plot_ranks(ranks: Mapping[str, Ranks], path: Path, bins: int = 10) -> None:
    """Histograms of ranks, with the 95 % band of a uniform distribution."""
    figure = Figure(figsize=(2.4 * len(ranks), 2.3), layout="constrained")
    for index, (name, rank) in enumerate(ranks.items()):
        axes = figure.add_subplot(1, len(ranks), index + 1, xlabel=f"rank of {name.replace('_', ' ')}")
        _histogram(axes, rank, bins)
        axes.set_title(f"p = {rank.p_value:.2g}, spread {rank.spread:.2f}", fontsize=8)
        if index == 0:
            axes.set_ylabel("truths")
    save(figure, path)


def plot_reliability(result: Reliability, path: Path) -> None:
    """Share of successes against predicted probability, and how often each is predicted."""
    figure = Figure(figsize=(4.2, 4.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    upper.plot([0, 1], [0, 1], color="0.4", linewidth=0.8)
    upper.plot(result.predicted, result.observed, marker="o", color=BLUE)
    upper.set(ylabel="share of successes", xlim=(0, 1), ylim=(0, 1))
    upper.set_title(f"ECE {result.ece:.3f}, Brier {result.brier:.3f}, AUC {result.auc:.3f}", fontsize=9)
    bins = len(result.share)
    lower.bar((np.arange(bins) + 0.5) / bins, result.share, width=0.9 / bins, color=BLUE)
    lower.set(xlabel="predicted p(S=1 | i, h)", ylabel="share of attempts", yscale="log")
    save(figure, path)


def plot_spread(spread: np.ndarray, path: Path) -> None:
    """Distribution of the ensemble's disagreement."""
    figure = Figure(figsize=(4.2, 3.0), layout="constrained")
    axes = figure.add_subplot(xlabel="standard deviation of log p(S=1 | i, h), nats", ylabel="hands")
    axes.hist(spread, bins=40, color=BLUE)
    axes.axvline(float(np.median(spread)), color=RED, label=f"median {np.median(spread):.2f}")
    axes.legend(fontsize=8)
    save(figure, path)


def save(figure: Figure, path: Path) -> None:
    """Write a figure; the format follows from the file's name."""
    make_directory(path.parent)
    FigureCanvasAgg(figure)
    write_through(path, lambda file: figure.savefig(file, format=path.suffix.lstrip("."), dpi=150))


def _histogram(axes: Axes, rank: Ranks, bins: int) -> None:
    counts, total = rank.histogram(bins), len(rank.ranks)
    # Each truth falls into a given bin with probability 1 / bins.
    low, high = (stats.binom.ppf(q, total, 1 / bins) for q in ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2))
    axes.axhspan(low, high, color=GREY)
    axes.axhline(total / bins, color="0.4", linewidth=0.8)
    axes.bar((np.arange(bins) + 0.5) / bins, counts, width=0.9 / bins, color=BLUE)
    axes.set_xlim(0, 1)
