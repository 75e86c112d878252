"""The benchmark's figures: the ladder of strategies beside the paper's, and the rates per object (its appendix)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bayesgrasp.diagnostics.intervals import wilson
from bayesgrasp.diagnostics.plots import BLUE, save
from bayesgrasp.evaluation.shifts import NONE
from bayesgrasp.evaluation.tables import LABELS, PAPER_ATTEMPTS
from bayesgrasp.posterior.potential import Prior

PER_OBJECT = ("map_success_ratio", "map_image", "map_full", "plan", "top_down", "force_closure")
COLORS = ("0.6", "tab:blue", "tab:green", "tab:purple", "tab:orange", "tab:brown")


def plot_ladder(summary: Mapping[str, Any], path: Path, split: str = "train") -> None:
    """Rates of success (with their 95 % interval) and of holding, and the paper's where it has one."""
    strategies = summary["strategies"]
    figure = Figure(figsize=(7.5, 0.6 + 0.42 * len(strategies)), layout="constrained")
    axes = figure.add_subplot(xlim=(0, 100), xlabel="success rate, %")
    for place, entry in enumerate(strategies.values()):
        _bar(axes, place, entry)
        published = (entry["paper"] or {}).get("unseen" if split == "unseen" else "train")
        if published is not None:
            label = None if "paper" in axes.get_legend_handles_labels()[1] else "paper"
            _marker(axes, place, published, label)
    axes.set_yticks(range(len(strategies)), [f"{_label(name)}\n{name}" for name in strategies], fontsize=7)
    axes.invert_yaxis()
    axes.grid(axis="x", color="0.9")
    axes.set_axisbelow(True)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=8)
    save(figure, path)


def plot_per_object(summary: Mapping[str, Any], path: Path) -> None:
    """Success rates by object, for the strategies of `PER_OBJECT` that ran, worst object of the first bar first."""
    strategies = {name: summary["strategies"][name] for name in PER_OBJECT if name in summary["strategies"]}
    strategies = strategies or dict(list(summary["strategies"].items())[:4])
    main = "map_image" if "map_image" in strategies else next(iter(strategies))
    objects = sorted(
        {name for entry in strategies.values() for name in entry["per_object"]},
        key=lambda name: (strategies[main]["per_object"].get(name, {"success_rate": 2.0})["success_rate"], name),
    )
    figure = Figure(figsize=(max(6.0, 0.55 * len(objects) + 2.0), 4.0), layout="constrained")
    axes = figure.add_subplot(ylim=(0, 100), ylabel="success rate, %")
    width = 0.85 / len(strategies)
    for index, (name, entry) in enumerate(strategies.items()):
        places = np.arange(len(objects)) + (index + 0.5) * width - 0.425
        color = COLORS[PER_OBJECT.index(name)] if name in PER_OBJECT else f"C{index}"
        _object_bars(axes, places, width, [entry["per_object"].get(o) for o in objects], color, name)
    axes.set_xticks(range(len(objects)), [_short(name) for name in objects], rotation=60, ha="right", fontsize=7)
    axes.grid(axis="y", color="0.9")
    axes.set_axisbelow(True)
    axes.legend(ncols=3, fontsize=7, loc="upper left", bbox_to_anchor=(0, 1.16))
    save(figure, path)


def _bar(axes: Axes, place: int, entry: Mapping[str, Any]) -> None:
    rate, (low, high) = entry["success_rate"], entry["interval"]
    label = "holds against pushes" if place == 0 else None
    axes.barh(place, 100 * rate, color=BLUE, height=0.6, alpha=0.45)
    axes.barh(place, 100 * entry["hold_rate"], color=BLUE, height=0.25, label=label)
    errors = 100 * np.array([[max(rate - low, 0.0)], [max(high - rate, 0.0)]])
    axes.errorbar(100 * rate, place, xerr=errors, color="0.15", capsize=2, linewidth=1)
    axes.text(min(100 * high + 1.5, 90.0), place - 0.18, f"{100 * rate:.1f}", fontsize=7, va="center")


def _marker(axes: Axes, place: int, rate: float, label: str | None) -> None:
    low, high = wilson(round(rate * PAPER_ATTEMPTS), PAPER_ATTEMPTS)
    errors = 100 * np.array([[rate - low], [high - rate]])
    axes.errorbar(
        100 * rate, place + 0.18, xerr=errors, color="tab:red", marker="D", markersize=4, capsize=2, label=label
    )


def _object_bars(
    axes: Axes, places: np.ndarray, width: float, cells: list[Mapping[str, Any] | None], color: str, name: str
) -> None:
    there = [(place, cell) for place, cell in zip(places, cells, strict=True) if cell is not None]
    rates = np.array([cell["success_rate"] for _, cell in there])
    bounds = np.array([cell["interval"] for _, cell in there]).reshape(-1, 2)
    errors = 100 * np.maximum([rates - bounds[:, 0], bounds[:, 1] - rates], 0.0)
    where = [place for place, _ in there]
    axes.bar(where, 100 * rates, width, color=color, label=name, yerr=errors, error_kw={"linewidth": 0.6})


def _label(name: str) -> str:
    return LABELS[name].replace("\\|", "|")


def _short(name: str) -> str:
    return name.removeprefix("household_")


def plot_prior(prior: Prior, path: Path, rng: np.random.Generator, draws: int = 600) -> None:
    """Draws from the prior of hands: positions, and the axes of the hand on the unit sphere (paper, prior figure)."""
    hands = prior.sample(draws, rng)
    figure = Figure(figsize=(8.5, 4.0), layout="constrained")
    positions = figure.add_subplot(1, 2, 1, projection="3d")
    positions.scatter(*hands.position.numpy().T, s=5, c=BLUE, alpha=0.6)
    positions.set(xlabel="x (m)", ylabel="y (m)", zlabel="z (m)", title="p(x)")
    axes = figure.add_subplot(1, 2, 2, projection="3d")
    for column, color in enumerate(("tab:red", "tab:green", "tab:blue")):
        axes.scatter(*hands.rotation[:, :, column].numpy().T, s=5, c=color, alpha=0.5, label="xyz"[column])
    axes.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(-1, 1), title="p(R): axes of the hand")
    axes.legend(fontsize=8)
    for part in (positions, axes):
        part.tick_params(labelsize=7)
    save(figure, path)


def plot_transfer(summary: Mapping[str, Any], path: Path) -> None:
    """Points lost, with their 95 % intervals: success filled, holding open.

    Each strategy has a panel with a row for every shift; where there are more strategies than shifts, the reverse.
    """
    losses = {
        (name, shift): entry
        for name, entries in summary["strategies"].items()
        for shift, entry in entries.items()
        if shift != NONE.name
    }
    strategies, shifts = (list(dict.fromkeys(names)) for names in zip(*losses, strict=True))
    by_strategy = len(strategies) <= len(shifts)
    panels, rows = (strategies, shifts) if by_strategy else (shifts, strategies)
    figure = Figure(figsize=(3.2 * len(panels) + 1.2, 1.4 + 0.3 * len(rows)), layout="constrained")
    for axes, panel in zip(
        figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0], panels, strict=True
    ):
        entries = [losses[(panel, row) if by_strategy else (row, panel)] for row in rows]
        for kind, offset, fill in (("success_lost", -0.12, BLUE), ("hold_lost", 0.12, "white")):
            _losses(axes, [entry[kind] for entry in entries], offset, fill, kind.removesuffix("_lost"))
        axes.axvline(0, color="0.5", linewidth=0.8)
        axes.set(title=panel, xlabel="points lost", ylim=(len(rows) - 0.5, -0.5))
        axes.set_yticks(range(len(rows)), rows, fontsize=8)
        axes.grid(axis="x", color="0.9")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8)
    save(figure, path)


def _losses(axes: Axes, losses: list[Mapping[str, Any]], offset: float, fill: str, label: str) -> None:
    means = 100 * np.array([loss["difference"] for loss in losses])
    bounds = 100 * np.array([loss["interval"] for loss in losses]).reshape(-1, 2)
    places = np.arange(len(losses)) + offset
    axes.hlines(places, bounds[:, 0], bounds[:, 1], color=BLUE, linewidth=1)
    axes.plot(means, places, "o", color=BLUE, markerfacecolor=fill, markersize=4, label=label)
