"""Do moved successes still succeed? Tries successes of a data set again: as they were, moved, and refreshed.

    python benchmarks/refresh.py --data DIR [--ycb-dir DIR] [--successes 300] [--json results/refresh.json]

With the nuisances kept, an attempt that is not moved repeats bit for bit, so the rows show how far outcomes follow a
move of hand and object together. With new nuisances the lift test is a draw from p(S | h, O, p_O), which a refresh must
leave alone: originals and refreshed successes are tried under the same draws, `TRIES` for each. Intervals of rates
are Wilson's and take tries for independent; that of the difference is over successes, each with all its tries.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro

from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.data.schema import AttemptRecords
from bayesgrasp.diagnostics.intervals import wilson
from bayesgrasp.files import write_json
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.prior.nuisance import NuisancePrior
from bayesgrasp.prior.planar_symmetry import moved, to_object
from bayesgrasp.seeding import generator
from bayesgrasp.types import Attempts, Outcome
from bayesgrasp.workflows.training_data import planar_refresh

MOVES = ((0.1, 0.01), (1.0, 0.1), (5.0, 2.0))
"""Moves of hand and object together: millimetres in a random direction, degrees in a random sense."""
TRIES = 2
"""New nuisances for each success."""
ORIGINAL, REFRESHED = "original, new nuisances", "refreshed, new nuisances"


def main(
    data: Path, ycb_dir: Path | None = None, successes: int = 300, seed: int = 0, json: Path | None = None
) -> None:
    """Try successes of a data set again and print a table.

    Args:
        data: A data set of `bayesgrasp generate`.
        ycb_dir: Scans; by default $BAYESGRASP_YCB_DIR.
        successes: How many, drawn at random.
        seed: Of the choice and of the moves.
        json: Where to write the numbers.
    """
    torch.set_num_threads(1)
    dataset = GraspDataset(data)
    there = chosen(dataset, successes, seed)
    test = LiftTest(load_objects(list(dataset.object_ids), ycb_dir))
    outcomes = {}
    for name, attempts in variants(there, dataset, seed):
        outcomes[name] = test.run(attempts)
        print(f"{name:26s} {line(rate(outcomes[name]))}", flush=True)
    report = summarize(there, outcomes, dataset) | {
        "command": f"python benchmarks/refresh.py --data DIR --ycb-dir DIR --successes {successes} --seed {seed}"
    }
    gap = report["original minus refreshed"]
    print(f"original minus refreshed: {gap['difference']:.2%} +- {gap['standard_error']:.2%} (one standard error)")
    if json is not None:
        write_json(json, report)


def chosen(dataset: GraspDataset, count: int, seed: int) -> AttemptRecords:
    """So many different successes of a data set, or all there are."""
    shards = (dataset.store.attempts(chunk) for chunk in sorted(dataset.entries))
    found = AttemptRecords.cat([shard[shard.outcome == Outcome.SUCCESS] for shard in shards])
    return found[np.sort(generator(seed, 0).permutation(len(found))[:count])]


def variants(there: AttemptRecords, dataset: GraspDataset, seed: int) -> Iterator[tuple[str, Attempts]]:
    """What is tried, by name."""
    yield "original", there
    for k, (millimetres, degrees) in enumerate(MOVES):
        yield f"moved {millimetres:g} mm, {degrees:g} deg", shifted(there, millimetres, degrees, generator(seed, 1, k))
    refresh, rng = planar_refresh(dataset), generator(seed, 2)
    fresh, _ = refresh.redraw(there, np.ones(len(there), dtype=bool), rng)
    yield "refreshed", fresh
    again = there[np.tile(np.arange(len(there)), TRIES)]
    fresh, _ = refresh.redraw(again, np.ones(len(again), dtype=bool), rng)
    stated = dataset.manifest.config["generate"]["nuisance"]
    nuisance = NuisancePrior(**{name: tuple(interval) for name, interval in stated.items()})
    drawn = nuisance.sample(len(again), generator(seed, 3)).columns()
    yield ORIGINAL, replace(again, **drawn)
    yield REFRESHED, replace(fresh, **drawn)


def shifted(there: Attempts, millimetres: float, degrees: float, rng: np.random.Generator) -> Attempts:
    """Hand and object moved together, so far in a random direction and turned so far in a random sense."""
    pose = there.object_pose.astype(np.float64)
    angle = rng.uniform(0.0, 2 * np.pi, len(there))
    pose[:, :2] += 1e-3 * millimetres * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    pose[:, 2] += np.deg2rad(degrees) * rng.choice([-1.0, 1.0], len(there))
    return moved(there, to_object(there), pose)


def summarize(there: AttemptRecords, outcomes: dict[str, np.ndarray], dataset: GraspDataset) -> dict[str, Any]:
    """The content of the JSON file."""
    return {
        "data": {"seed": dataset.manifest.seed, "attempts": dataset.manifest.attempts},
        "successes": len(there),
        "objects": len(np.unique(there.object_index)),
        "tries": TRIES,
        "rates": {name: rate(found) for name, found in outcomes.items()},
        "original minus refreshed": difference(outcomes[ORIGINAL], outcomes[REFRESHED]),
    }


def rate(outcomes: np.ndarray) -> dict[str, Any]:
    """Successes, attempts, the interval of the rate, and how the others ended."""
    hits, total = int((outcomes == Outcome.SUCCESS).sum()), len(outcomes)
    low, high = wilson(hits, total)
    others = {o.name.lower(): int((outcomes == o).sum()) for o in Outcome if o != Outcome.SUCCESS}
    ends = {name: count for name, count in others.items() if count}
    return {"successes": hits, "attempts": total, "rate": hits / total, "interval": [low, high], "others": ends}


def line(row: dict[str, Any]) -> str:
    """A row of the table."""
    low, high = row["interval"]
    others = ", ".join(f"{count} {name}" for name, count in row["others"].items())
    return f"{row['successes']} of {row['attempts']}: {row['rate']:.1%} ({low:.1%} to {high:.1%})  {others}"


def difference(original: np.ndarray, refreshed: np.ndarray) -> dict[str, float]:
    """How much more often originals succeed, with the standard error over successes."""
    gaps = (original == Outcome.SUCCESS).astype(float) - (refreshed == Outcome.SUCCESS)
    by_success = gaps.reshape(TRIES, -1).mean(axis=0)
    error = by_success.std(ddof=1) / np.sqrt(len(by_success))
    return {"difference": float(by_success.mean()), "standard_error": float(error)}


if __name__ == "__main__":
    tyro.cli(main)
