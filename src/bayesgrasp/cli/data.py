"""``bayesgrasp data inspect``: what a data set holds, in words, numbers and a picture."""

from __future__ import annotations

from dataclasses import asdict, astuple
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from bayesgrasp.data.effective import Effective, effective_successes
from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.data.manifest import TABLES
from bayesgrasp.data.sheet import draw_sheet
from bayesgrasp.files import check_target, write_json, write_through
from bayesgrasp.generation.run import totals
from bayesgrasp.types import Outcome


def inspect(
    directory: Path, sheet: Path | None = None, verify: bool = False, seed: int = 0, json: Path | None = None
) -> None:
    """Print the manifest, the outcomes, the success of each object, what its hands are worth and the disk use.

    Successful hands of scenes are counted, and how many independent ones they are worth by their weights: `weight` is
    for ratios of densities, `selection` for p(S=1 | i, h). A sheet of images with successful hands is drawn as well.

    Args:
        directory: Of the data set.
        sheet: Where the picture goes; by default sheet.png in the data set.
        verify: Also compare every file with its checksum.
        seed: Which images are drawn.
        json: Write the numbers of the tables to this file.
    """
    if json is not None:
        check_target(json)
    dataset = GraspDataset(directory)
    _print_manifest(dataset)
    if verify:
        for entry in dataset.entries.values():
            dataset.store.verify(entry)
        print(f"checked: {len(dataset.entries)} chunks are as they were written")
    counts = totals(dataset.entries)
    _print_outcomes(dataset, counts["per_object"])
    print(f"{counts['scenes']} images")
    _print_disk(directory, counts["attempts"], counts["scenes"])
    if json is not None:
        write_json(json, _numbers_of(dataset, counts))
    if counts["scenes"]:
        _print_effective(dataset)
        _draw(dataset, sheet or directory / "sheet.png", seed)


def _print_manifest(dataset: GraspDataset) -> None:
    manifest = dataset.manifest
    settings = manifest.config.get("generate", {})
    state = "finished" if manifest.totals else "not finished"
    print(f"{dataset.store.directory}: {state}, {manifest.attempts} attempts asked for, seed {manifest.seed}")
    print(f"schema {manifest.schema_version}, bayesgrasp {manifest.version}, commit {manifest.commit or 'unknown'}")
    print(
        f"gripper {manifest.gripper}, {len(manifest.objects)} objects, proposal {settings.get('proposal', 'unknown')}"
    )


def _print_outcomes(dataset: GraspDataset, per_object: dict[str, list[int]]) -> None:
    names = [outcome.name.lower().replace("_", " ") for outcome in Outcome]
    table = Table("object", "attempts", *names, "share", "under the prior")
    prior = _prior_rates(dataset)
    total = [sum(column) for column in zip(*per_object.values(), strict=True)]
    for index, counts in per_object.items():
        share = counts[Outcome.SUCCESS] / sum(counts)
        name, rate = dataset.object_ids[int(index)], prior.get(int(index), 0.0)
        table.add_row(name, str(sum(counts)), *map(str, counts), f"{share:.2%}", f"{rate:.2%}")
    mean = sum(prior.values()) / max(len(prior), 1)
    table.add_section()
    table.add_row("all", str(sum(total)), *map(str, total), f"{total[Outcome.SUCCESS] / sum(total):.2%}", f"{mean:.2%}")
    Console(width=max(Console().width, 150)).print(table)


def _numbers_of(dataset: GraspDataset, counts: dict[str, Any]) -> dict[str, Any]:
    """What the tables say, as JSON-able data."""
    prior, names = _prior_rates(dataset), dataset.object_ids
    per_object: dict[str, dict[str, Any]] = {}
    for index, outcomes in counts["per_object"].items():
        number = int(index)
        per_object[names[number]] = {
            "attempts": sum(outcomes),
            "outcomes": {outcome.name.lower(): outcomes[outcome] for outcome in Outcome},
            "success_rate": outcomes[Outcome.SUCCESS] / sum(outcomes),
            "success_rate_under_prior": prior.get(number, 0.0),
            "effective": asdict(effective_successes(dataset.scene_columns, number)) if counts["scenes"] else None,
        }
    return {"attempts": counts["attempts"], "scenes": counts["scenes"], "per_object": per_object}


def _prior_rates(dataset: GraspDataset) -> dict[int, float]:
    """Success of each object under the prior: the weighted share of its successes, chunk by chunk."""
    objects = len(dataset.object_ids)
    tried, held = np.zeros(objects), np.zeros(objects)
    for chunk in dataset.entries:
        records = dataset.store.attempts(chunk)
        weight = np.exp(records.log_weight.astype(np.float64))
        tried += np.bincount(records.object_index, weight, objects)
        held += np.bincount(records.object_index, weight * (records.outcome == Outcome.SUCCESS), objects)
    return {index: float(held[index] / tried[index]) for index in range(objects) if tried[index] > 0}


def _print_effective(dataset: GraspDataset) -> None:
    columns = ("successful hands", "worth by weight", "by selection", "of attempts", "worth by weight", "by selection")
    table = Table("object", *columns)
    for index, name in enumerate(dataset.object_ids):
        table.add_row(name, *_numbers(effective_successes(dataset.scene_columns, index)))
    table.add_section()
    table.add_row("all", *_numbers(effective_successes(dataset.scene_columns)))
    Console(width=max(Console().width, 130)).print(table)


def _numbers(effective: Effective) -> list[str]:
    return [f"{value:.0f}" for value in astuple(effective)]


def _print_disk(directory: Path, attempts: int, scenes: int) -> None:
    sizes = {name: _size(directory / name) for name in (*TABLES, "cache")}
    print("disk: " + ", ".join(f"{name} {size / 2**20:.1f} MiB" for name, size in sizes.items()))
    per_scene = f", {sizes['scenes'] / scenes:.0f} bytes an image with its hands" if scenes else ""
    print(f"{sizes['attempts'] / attempts:.1f} bytes an attempt{per_scene}")


def _size(directory: Path) -> int:
    return sum(path.stat().st_size for path in directory.rglob("*") if path.is_file())


def _draw(dataset: GraspDataset, path: Path, seed: int) -> None:
    check_target(path)
    sheet = draw_sheet(dataset, seed=seed)
    write_through(path, lambda file: sheet.save(file, format="PNG"))
    print(f"wrote {path}: images with up to four successful hands (red basic, green wide, blue pinch)")
