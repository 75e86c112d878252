"""``bayesgrasp transfer``: what strategies lose when the world is not the one that the model was trained in."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bayesgrasp.evaluation.journal import SceneResult


def transfer(
    out: Path,
    model: Path | None = None,
    attempts: int = 1000,
    split: str = "train",
    ycb_dir: Path | None = None,
    mesh: Path | None = None,
    mass: float | None = None,
    seed: int = 0,
    strategies: tuple[str, ...] = ("map_image", "mle_image", "plan"),
    shifts: tuple[str, ...] = (),
    starts: int = 1,
    steps: int = 20,
    workers: int = os.cpu_count() or 1,
    resume: bool = False,
) -> None:
    """Measure what strategies lose to another engine, other objects, and another sensor.

    The shifts: PyBullet for MuJoCo, masses times 0.7 and 1.3, frictions at the ends of their prior, objects of 0.8 and
    1.2 times their size, a stereo camera. Every shift meets the same scenes with the same random numbers. A strategy
    plans again only where the shift changes what it looks at; otherwise the very same grasp is executed. Each shift is
    a benchmark of its own in OUT/SHIFT, so a run that was interrupted goes on with --resume, which may also add shifts
    or attempts.

    Args:
        out: Directory for transfer.json, transfer.md, transfer.png, and the results of every shift.
        model: Directory of a trained model; by default the one that comes with the package.
        attempts: Scenes, which is attempts of each strategy under each shift; objects take turns.
        split: train, train-ycb, unseen, household, stand-ins, other, all, or one object's id.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        mesh: A mesh file to use instead (metres, z upwards); needs --mass.
        mass: Its mass, kg.
        seed: Same seed, same scenes and plans, for any number of workers.
        strategies: Which ones, as `bayesgrasp benchmark` names them; `all` for all of them.
        shifts: Which ones, as `bayesgrasp benchmark` names them; by default all of them.
        starts: Ascents for each grasp type; the paper's search has 1.
        steps: Of each ascent; the paper's search has 20.
        workers: Processes.
        resume: Go on with the run in --out, or start it where there is none.
    """
    from bayesgrasp.cli.benchmark import (
        LoadModel,
        announce_skipped,
        describe_run,
        run_with_progress,
        search_config,
        write_results,
    )
    from bayesgrasp.errors import InvalidConfigurationError
    from bayesgrasp.evaluation.runner import Benchmark
    from bayesgrasp.evaluation.shifts import NONE, SHIFTS, find_shift
    from bayesgrasp.evaluation.strategies import STRATEGIES
    from bayesgrasp.evaluation.tables import summarize
    from bayesgrasp.objects.catalogue import load_objects
    from bayesgrasp.ratio.checkpoint import read_card
    from bayesgrasp.workflows.load import DEFAULT_MODEL

    directory = DEFAULT_MODEL if model is None else model
    card = read_card(directory)
    named = [find_shift(name) for name in dict.fromkeys((NONE.name, *(shifts or SHIFTS)))]
    if named == [NONE]:
        raise InvalidConfigurationError("nothing can be lost without a shift: name another than none")
    chosen = Benchmark(
        load_objects(split, ycb_dir, mesh, mass),
        LoadModel(directory),
        STRATEGIES if "all" in strategies else tuple(dict.fromkeys(strategies)),
        seed,
        search_config(starts, steps),
    )
    reasons = announce_skipped(chosen, card)
    origin = describe_run(chosen, card, split) | {"skipped": reasons}
    results: dict[str, Sequence[SceneResult]] = {}
    for shift in named:
        shifted, known = replace(chosen, shift=shift), results.get(NONE.name, ())
        found = run_with_progress(shifted, card, attempts, workers, out / shift.name, resume, known)
        results[shift.name] = found
        details = {"engine": shift.engine, "shift": shift.name, **summarize(found, reasons)}
        write_results(origin | details, out / shift.name, split)
    _write(origin, results, out)


def _write(origin: dict[str, Any], results: dict[str, Sequence[SceneResult]], out: Path) -> None:
    from bayesgrasp.evaluation.figures import plot_transfer
    from bayesgrasp.evaluation.transfer import markdown_transfer, summarize_transfer

    summary = {**origin, **summarize_transfer(results)}
    (out / "transfer.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    (out / "transfer.md").write_text(markdown_transfer(summary), encoding="utf-8")
    plot_transfer(summary, out / "transfer.png")
    print(markdown_transfer(summary), end="")
    print(f"wrote {out}")
