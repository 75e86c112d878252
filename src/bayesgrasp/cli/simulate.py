"""``bayesgrasp simulate``: lift tests from the prior, with a table per object and a picture."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.table import Table

from bayesgrasp.cli.object_set import Objects, ObjectSet
from bayesgrasp.cli.progress import lift_testing
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.trial_counts import count_trials
from bayesgrasp.files import check_target, write_json
from bayesgrasp.generation.trials import Priors, Simulation, Trials
from bayesgrasp.lift.bullet.client import require
from bayesgrasp.lift.lift_config import EngineName, LiftTestConfig
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.types import Outcome
from bayesgrasp.viewer.film import save_film

FILMED = 3
"""Attempts of each kind in a picture."""


@dataclass(frozen=True)
class Physics:
    """Of the lift test, and the prior of hands.

    Attributes:
        screening: Decide certain outcomes without physics (same outcomes, faster).
        rotation: The paper's prior of rotations, or uniform rotations for comparison.
        engine: Physics of the attempts that screening cannot decide; pybullet is an optional extra of the package.
        criterion: What success means: that the object was lifted, or that it was also held against six pushes.
    """

    screening: bool = True
    rotation: Literal["modes", "uniform"] = "modes"
    engine: EngineName = "mujoco"
    criterion: Literal["lift", "hold"] = "lift"


@dataclass(frozen=True)
class Outputs:
    """Files to write.

    Attributes:
        json: Write the counts to this file.
        video: Write what attempts looked like: a .png with rows of frames (successes, then drops), or a .gif of one.
    """

    json: Path | None = None
    video: Path | None = None

    def check(self) -> None:
        """Refuse before the work, not after it."""
        for path in (self.json, self.video):
            if path is not None:
                check_target(path)
        if self.video is not None and self.video.suffix not in (".png", ".gif"):
            raise InvalidConfigurationError(f"--video writes .png or .gif, not '{self.video.suffix}'")


def simulate(
    attempts: int = 2000,
    objects: Objects = ObjectSet(),  # noqa: B008 - frozen
    seed: int = 0,
    workers: int = os.cpu_count() or 1,
    physics: Annotated[Physics, tyro.conf.OmitArgPrefixes] = Physics(),
    outputs: Annotated[Outputs, tyro.conf.OmitArgPrefixes] = Outputs(),
) -> None:
    """Run lift tests on hand configurations drawn from the prior.

    Args:
        attempts: How many.
        objects: Which objects.
        seed: Same seed, same result, for any number of workers.
        workers: Processes.
        physics: Of the lift test, and the prior of hands.
        outputs: Files to write.
    """
    outputs.check()
    config = LiftTestConfig(engine=physics.engine, criterion=physics.criterion)
    if physics.engine == "pybullet":
        require()
    assets = objects.load()
    priors = replace(Priors(), grasp=GraspPrior(rotation=physics.rotation))
    start = perf_counter()
    with lift_testing(attempts) as progress:
        trials = Simulation(assets, seed, priors, config, physics.screening).run(attempts, workers, progress)
    summary = count_trials(trials, assets, perf_counter() - start)
    _print_table(summary)
    if outputs.json is not None:
        asked = {name: value for name, value in vars(physics).items() if name != "screening"}
        write_json(outputs.json, summary | {"seed": seed, "split": objects.split} | asked, indent=2)
    if outputs.video is not None:
        _film(trials, assets, config, outputs.video)


_HEADINGS = {"unreachable": "unrch", "collision": "colld", "no_contact": "empty", "dropped": "drop", "success": "succ"}


def _print_table(summary: dict[str, Any]) -> None:
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


def _film(trials: Trials, objects: tuple[ObjectAsset, ...], config: LiftTestConfig, path: Path) -> None:
    kinds = (Outcome.SUCCESS, Outcome.DROPPED)
    chosen = [row for outcome in kinds for row in (trials.outcomes == outcome).nonzero()[0][:FILMED]]
    if not chosen:
        print(f"no attempt touched an object: nothing to show, {path} not written")
        return
    attempts = [trials.attempts[[row]] for row in chosen]
    save_film(path, objects, attempts, config)
    names = ", ".join(
        f"{objects[int(a.object_index[0])].id} ({Outcome(trials.outcomes[row]).name.lower()})"
        for a, row in zip(attempts, chosen, strict=True)
    )
    print(f"wrote {path}: {names}")
