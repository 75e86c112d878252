"""How much a strategy loses to every shift: paired rates, as JSON and Markdown.

The same scenes are run with and without a shift, so a loss is the mean over scenes of S_without - S_with, in points
(hundredths), with the interval of paired attempts (`diagnostics.intervals.paired_difference`); positive is worse. The
same is done for the harder label, that the grasp holds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesgrasp.diagnostics.intervals import paired_difference
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.journal import SceneResult, Trial
from bayesgrasp.evaluation.shifts import NONE
from bayesgrasp.evaluation.strategies import STRATEGIES
from bayesgrasp.evaluation.tables import rates


def summarize_transfer(results: Mapping[str, Sequence[SceneResult]]) -> dict[str, Any]:
    """The content of the JSON file: for each strategy under ``strategies`` its rates by shift, and its losses.

    Args:
        results: By name of the shift; those without a shift are among them.

    Raises:
        InvalidConfigurationError: Results without a shift are missing, or were obtained in other scenes.
    """
    numbers = {name: [result.number for result in runs] for name, runs in results.items()}
    if NONE.name not in results or any(found != numbers[NONE.name] for found in numbers.values()):
        raise InvalidConfigurationError("losses need results with and without a shift in the same scenes")
    base = results[NONE.name]
    present = [name for name in STRATEGIES if any(name in result.trials for result in base)]
    return {
        "scenes": len(base),
        "strategies": {name: {shift: _entry(name, base, runs) for shift, runs in results.items()} for name in present},
    }


def markdown_transfer(summary: Mapping[str, Any]) -> str:
    """One row for each strategy and shift."""
    lines = [
        "| strategy | shift | success | points lost | 95 % | holds | points lost | 95 % | n |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name, shifts in summary["strategies"].items():
        lines += [_row(name, shift, entry) for shift, entry in shifts.items()]
    return "\n".join(lines) + "\n"


def _entry(name: str, base: Sequence[SceneResult], runs: Sequence[SceneResult]) -> dict[str, Any]:
    pairs = [(a.trials[name], b.trials[name]) for a, b in zip(base, runs, strict=True) if name in a.trials]
    return {
        **rates([after for _, after in pairs]),
        "success_lost": _loss([(before.success, after.success) for before, after in pairs]),
        "hold_lost": _loss([(before.held, after.held) for before, after in pairs]),
        "same_grasp": sum(_hand(before) == _hand(after) for before, after in pairs),
    }


def _loss(pairs: Sequence[tuple[bool, bool]]) -> dict[str, Any]:
    before, after = np.array(pairs, dtype=bool).T
    mean, interval = paired_difference(before, after)
    broken, mended = int((before & ~after).sum()), int((after & ~before).sum())
    return {"difference": mean, "interval": list(interval), "broken": broken, "mended": mended}


def _hand(trial: Trial) -> tuple[object, ...]:
    return trial.position, trial.quaternion, trial.grasp_type


def _row(name: str, shift: str, entry: Mapping[str, Any]) -> str:
    lost, hold_lost = ("-", "-"), ("-", "-")
    if shift != NONE.name:
        lost, hold_lost = _points(entry["success_lost"]), _points(entry["hold_lost"])
    cells = (
        f"`{name}`",
        shift,
        f"{100 * entry['success_rate']:.1f} %",
        *lost,
        f"{100 * entry['hold_rate']:.1f} %",
        *hold_lost,
        str(entry["attempts"]),
    )
    return f"| {' | '.join(cells)} |"


def _points(loss: Mapping[str, Any]) -> tuple[str, str]:
    low, high = loss["interval"]
    return f"**{100 * loss['difference']:+.1f}**", f"{100 * low:+.1f} to {100 * high:+.1f}"
