"""``bayesgrasp simulate``: lift tests from the prior, with a table per object and a picture."""

from __future__ import annotations

import json as json_module
import os
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from bayesgrasp.generation.trials import Trials
    from bayesgrasp.lift.lift_config import LiftTestConfig
    from bayesgrasp.objects.object_asset import ObjectAsset


def simulate(
    attempts: int = 2000,
    split: str = "train",
    ycb_dir: Path | None = None,
    mesh: Path | None = None,
    mass: float | None = None,
    seed: int = 0,
    workers: int = os.cpu_count() or 1,
    screening: bool = True,
    rotation: Literal["modes", "uniform"] = "modes",
    engine: Literal["mujoco", "pybullet"] = "mujoco",
    criterion: Literal["lift", "hold"] = "lift",
    json: Path | None = None,
    video: Path | None = None,
) -> None:
    """Run lift tests on hand configurations drawn from the prior.

    Args:
        attempts: How many.
        split: train, train-ycb, unseen, household, stand-ins, other, all, or one object's id.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        mesh: A mesh file to use instead (metres, z upwards); needs --mass.
        mass: Its mass, kg.
        seed: Same seed, same result, for any number of workers.
        workers: Processes.
        screening: Decide certain outcomes without physics (same outcomes, faster).
        rotation: The paper's prior of rotations, or uniform rotations for comparison.
        engine: Physics of the attempts that screening cannot decide; pybullet is an optional extra of the package.
        criterion: What success means: that the object was lifted, or that it was also held against six pushes.
        json: Write the counts to this file.
        video: Write what attempts looked like: a .png with rows of frames (successes, then drops), or a .gif of one.
    """
    from bayesgrasp.generation.trials import Priors, Simulation
    from bayesgrasp.lift.bullet.client import require
    from bayesgrasp.lift.lift_config import LiftTestConfig
    from bayesgrasp.objects.catalogue import load_objects
    from bayesgrasp.prior.grasp import GraspPrior

    _check_outputs(json, video)
    config = LiftTestConfig(engine=engine, criterion=criterion)
    if engine == "pybullet":
        require()
    objects = load_objects(split, ycb_dir, mesh, mass)
    priors = replace(Priors(), grasp=GraspPrior(rotation=rotation))
    start = perf_counter()
    with _progress(attempts) as advance:
        trials = Simulation(objects, seed, priors, config, screening).run(attempts, workers, advance)
    summary = summarize(trials, objects, perf_counter() - start)
    _print_table(summary)
    if json is not None:
        origin = {"seed": seed, "split": split, "rotation": rotation, "engine": engine, "criterion": criterion}
        json.write_text(json_module.dumps(summary | origin, indent=2))
    if video is not None:
        _write_video(trials, objects, config, video)


def summarize(trials: Trials, objects: tuple[ObjectAsset, ...], seconds: float) -> dict[str, Any]:
    """Counts and rates of some trials, in all and per object."""
    from bayesgrasp.types import Outcome

    def counts(mask: Any) -> dict[str, int]:
        return {o.name.lower(): int((trials.outcomes[mask] == o).sum()) for o in Outcome}

    index = trials.attempts.object_index
    per_object = {}
    for number, asset in enumerate(objects):
        mine = counts(index == number)
        total = sum(mine.values())
        per_object[asset.id] = {"attempts": total, "outcomes": mine} | _rate(mine["success"], total)
    return {
        "attempts": len(index),
        **_rate(trials.successes, len(index)),
        "outcomes": counts(slice(None)),
        "attempts_per_second": len(index) / seconds,
        "seconds": seconds,
        "per_object": per_object,
    }


def _rate(successes: int, attempts: int) -> dict[str, Any]:
    from bayesgrasp.diagnostics.intervals import wilson

    if attempts == 0:
        return {"success_rate": None, "interval": None}
    return {"success_rate": successes / attempts, "interval": list(wilson(successes, attempts))}


def _check_outputs(*paths: Path | None) -> None:
    """Refuse before the work, not after it."""
    from bayesgrasp.errors import InvalidConfigurationError

    for path in paths:
        if path is not None and not path.parent.is_dir():
            raise InvalidConfigurationError(f"cannot write {path}: there is no directory {path.parent}")
    video = paths[-1]
    if video is not None and video.suffix not in (".png", ".gif"):
        raise InvalidConfigurationError(f"--video writes .png or .gif, not '{video.suffix}'")


class _progress:  # noqa: N801 - used like a function
    """A progress bar over attempts, with the number of successes so far."""

    def __init__(self, total: int) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[found]} successes"))
        self.bar = Progress(TextColumn("lift tests"), *columns, TimeRemainingColumn())
        self.task = self.bar.add_task("", total=total, found=0)
        self.found = 0

    def __enter__(self) -> Any:
        self.bar.start()
        return self._advance

    def __exit__(self, *_: object) -> None:
        self.bar.stop()

    def _advance(self, trials: Trials) -> None:
        self.found += trials.successes
        self.bar.update(self.task, advance=len(trials.outcomes), found=self.found)


_HEADINGS = {"unreachable": "unrch", "collision": "colld", "no_contact": "empty", "dropped": "drop", "success": "succ"}


def _print_table(summary: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    names = [name for name in summary["outcomes"] if name != "diverged" or summary["outcomes"][name]]
    table = Table(box=None, pad_edge=False)
    table.add_column("object", no_wrap=True, overflow="fold")
    for heading in ("n", *(_HEADINGS.get(name, name) for name in names), "rate", "95 %"):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, row in {**summary["per_object"], "all": summary}.items():
        if row["attempts"]:
            low, high = row["interval"]
            counts = [str(row["outcomes"][n]) for n in names]
            rate = (f"{row['success_rate']:.2%}", f"{100 * low:.1f}-{100 * high:.1f}")
            table.add_row(name[:22], str(row["attempts"]), *counts, *rate)
    Console().print(table)
    print(f"{summary['attempts_per_second']:.0f} attempts/s ({summary['seconds']:.1f} s)")


def _write_video(trials: Trials, objects: tuple[ObjectAsset, ...], config: LiftTestConfig, path: Path) -> None:
    from PIL import Image

    from bayesgrasp.types import Outcome
    from bayesgrasp.viewer.film import film_attempt, film_sheet

    chosen = [r for o in (Outcome.SUCCESS, Outcome.DROPPED) for r in (trials.outcomes == o).nonzero()[0][:3]]
    if not chosen:
        print(f"no attempt touched an object: nothing to show, {path} not written")
        return
    attempts = [trials.attempts[[row]] for row in chosen]
    if path.suffix == ".png":
        Image.fromarray(film_sheet(objects, attempts, config=config)).save(path)
    else:
        frames = [Image.fromarray(f) for f in film_attempt(objects, attempts[0], 40, config)]
        frames[0].save(path, save_all=True, append_images=frames[1:], duration=60, loop=0)
    names = ", ".join(
        f"{objects[int(a.object_index[0])].id} ({Outcome(trials.outcomes[row]).name.lower()})"
        for a, row in zip(attempts, chosen, strict=True)
    )
    print(f"wrote {path}: {names}")
