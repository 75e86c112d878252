"""Counts and rates of lift tests from the prior, in all and per object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool

from bayesgrasp.diagnostics.intervals import wilson
from bayesgrasp.generation.trials import Trials
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.types import Outcome


def count_trials(trials: Trials, objects: Sequence[ObjectAsset], seconds: float) -> dict[str, Any]:
    """Outcomes, success rates and their 95 % intervals, as JSON-able data.

    Args:
        trials: Attempts with their outcomes.
        objects: The object set, in the order of `object_index`.
        seconds: That they took.
    """
    index = trials.attempts.object_index
    overall = _counts(trials, np.ones(len(index), dtype=bool))
    per_object = {}
    for number, asset in enumerate(objects):
        mine = _counts(trials, index == number)
        total = sum(mine.values())
        per_object[asset.id] = {"attempts": total, "outcomes": mine} | _rate(mine["success"], total)
    return {
        "attempts": len(index),
        **_rate(trials.successes, len(index)),
        "outcomes": overall,
        "attempts_per_second": len(index) / seconds,
        "seconds": seconds,
        "per_object": per_object,
    }


def _counts(trials: Trials, mask: Bool[np.ndarray, "n"]) -> dict[str, int]:
    return {outcome.name.lower(): int((trials.outcomes[mask] == outcome).sum()) for outcome in Outcome}


def _rate(successes: int, attempts: int) -> dict[str, Any]:
    if attempts == 0:
        return {"success_rate": None, "interval": None}
    return {"success_rate": successes / attempts, "interval": list(wilson(successes, attempts))}
