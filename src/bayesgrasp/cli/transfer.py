"""``bayesgrasp transfer``: what strategies lose when the world is not the one that the model was trained in."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from bayesgrasp.cli.benchmark import Contest, print_skipped
from bayesgrasp.cli.object_set import Objects, ObjectSet
from bayesgrasp.cli.progress import benchmarking
from bayesgrasp.evaluation.strategies import STRATEGIES
from bayesgrasp.evaluation.transfer import markdown_transfer
from bayesgrasp.locks import sole_writer
from bayesgrasp.workflows.evaluate import Evaluation, Transfer, shifts_named
from bayesgrasp.workflows.load import model_directory


@dataclass(frozen=True)
class Running:
    """How it is computed.

    Attributes:
        workers: Processes.
        resume: Go on with the run in --out, or start it where there is none.
    """

    workers: int = os.cpu_count() or 1
    resume: bool = False


CONTEST = Contest(("map_image", "mle_image", "plan"))


def transfer(
    out: Path,
    model: Path | None = None,
    attempts: int = 1000,
    objects: Objects = ObjectSet(),  # noqa: B008 - frozen
    seed: int = 0,
    contest: Annotated[Contest, tyro.conf.OmitArgPrefixes] = CONTEST,
    shifts: tuple[str, ...] = (),
    running: Annotated[Running, tyro.conf.OmitArgPrefixes] = Running(),
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
        objects: Which objects.
        seed: Same seed, same scenes and plans, for any number of workers.
        contest: Which strategies meet; `all` for all of them.
        shifts: Which ones, as `bayesgrasp benchmark` names them; by default all of them.
        running: How it is computed.
    """
    named = shifts_named(shifts)
    evaluation = Evaluation.of(
        model_directory(model),
        objects.load(),
        objects.split,
        strategies=STRATEGIES if "all" in contest.strategies else contest.strategies,
        seed=seed,
        search=contest.search,
    )
    print_skipped(evaluation)
    losses = Transfer(evaluation, out)
    with sole_writer(out):
        for shift in named:
            with benchmarking(attempts, shift.name) as progress:
                directory = losses.run(shift, attempts, running.workers, resume=running.resume, progress=progress)
            print(f"wrote {directory}")
        print(markdown_transfer(losses.write()), end="")
    print(f"wrote {out}")
