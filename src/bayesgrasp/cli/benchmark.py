"""``bayesgrasp benchmark``: every strategy of the paper's table and the baselines, on the same scenes."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from bayesgrasp.cli.object_set import Objects, ObjectSet
from bayesgrasp.cli.progress import benchmarking
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.journal import SceneResult
from bayesgrasp.evaluation.shifts import find_shift
from bayesgrasp.evaluation.strategies import SearchConfig
from bayesgrasp.evaluation.tables import markdown
from bayesgrasp.files import check_target, write_json
from bayesgrasp.lift.lift_config import EngineName
from bayesgrasp.posterior.ascent import AscentConfig
from bayesgrasp.prior.cameras import cameras_at
from bayesgrasp.workflows.evaluate import Evaluation
from bayesgrasp.workflows.load import model_directory


@dataclass(frozen=True)
class Contest:
    """Which strategies meet.

    Attributes:
        strategies: Which ones; by default all of them.
        starts: Ascents for each grasp type; the paper's search has 1.
        steps: Of each ascent; the paper's search has 20.
    """

    strategies: tuple[str, ...] = ()
    starts: int = 1
    steps: int = 20

    @property
    def search(self) -> SearchConfig:
        """The search of all strategies."""
        return SearchConfig(ascent=AscentConfig(starts_per_type=self.starts, steps=self.steps))


@dataclass(frozen=True)
class OtherWorld:
    """How the world departs from the one that the model was trained in, unknown to the planner.

    Attributes:
        engine: Physics of the lift test; by default that of the shift, which is MuJoCo for all but `pybullet`.
        shift: none, pybullet, mass-0.7, mass-1.3, friction-low, friction-high, stereo, scale-0.8 or scale-1.2.
        elevation: Take the images from these degrees above the horizon and from all sides instead of by the canonical
            camera, one table for each; results are in --out/elevation-DEGREES.
    """

    engine: EngineName | None = None
    shift: str = "none"
    elevation: tuple[float, ...] = ()


@dataclass(frozen=True)
class Outputs:
    """Files to write.

    Attributes:
        json: Write the summary to this file.
        out: Directory for results: scenes.jsonl, summary.json, table.md, per_object.md and figures.
        resume: Go on with the run in --out, or start it where there is none.
        failures: With --out, picture this many failures of the MAP from one image: failures.png.
    """

    json: Path | None = None
    out: Path | None = None
    resume: bool = False
    failures: int = 0

    def check(self) -> None:
        """Refuse before the work, not after it."""
        if self.json is not None:
            check_target(self.json)
        if self.out is None and (self.resume or self.failures):
            raise InvalidConfigurationError("--resume and --failures need the directory of the run: give --out")


def benchmark(
    model: Path | None = None,
    attempts: int = 1000,
    objects: Objects = ObjectSet(),  # noqa: B008 - frozen
    seed: int = 0,
    workers: int = os.cpu_count() or 1,
    contest: Annotated[Contest, tyro.conf.OmitArgPrefixes] = Contest(),
    world: Annotated[OtherWorld, tyro.conf.OmitArgPrefixes] = OtherWorld(),
    outputs: Annotated[Outputs, tyro.conf.OmitArgPrefixes] = Outputs(),
) -> None:
    """Measure the success rates of the paper's strategies and of two baselines.

    All strategies meet the same scenes; nuisances are drawn anew for every scene. Success is judged by the lift test,
    and beside it whether the grasp also holds the lifted object against pushes. Grasps that the arm cannot reach are
    failures and counted apart. With --out every finished scene is kept, and a run that was interrupted goes on with
    --resume; a resumed run may have more attempts.

    Args:
        model: Directory of a trained model; by default the one that comes with the package.
        attempts: Scenes, which is attempts of each strategy; objects take turns.
        objects: Which objects.
        seed: Same seed, same scenes and plans, for any number of workers.
        workers: Processes.
        contest: Which strategies meet.
        world: How the world departs from the one that the model was trained in.
        outputs: Files to write.
    """
    outputs.check()
    evaluation = Evaluation.of(
        model_directory(model),
        objects.load(),
        objects.split,
        strategies=contest.strategies,
        seed=seed,
        search=contest.search,
        shift=find_shift(world.shift, world.engine),
    )
    print_skipped(evaluation)
    summaries = {}
    for view, each in _views(evaluation, world.elevation).items():
        place = outputs.out / view if outputs.out is not None and view else outputs.out
        with benchmarking(attempts, view or world.shift) as progress:
            results = each.run(attempts, workers, place, resume=outputs.resume, progress=progress)
        summaries[view] = each.summary(results)
        print(markdown(summaries[view], f"{objects.split}, {view}" if view else objects.split), end="")
        if place is not None:
            _write(each, results, place, outputs.failures)
    if outputs.json is not None:
        write_json(outputs.json, summaries if world.elevation else summaries[""])


def _views(evaluation: Evaluation, elevation: tuple[float, ...]) -> dict[str, Evaluation]:
    """The benchmark from each elevation, by name; as it is where none is given."""
    if not elevation:
        return {"": evaluation}
    return {f"elevation-{one:g}": evaluation.seen_from(cameras_at(math.radians(one))) for one in elevation}


def _write(evaluation: Evaluation, results: Sequence[SceneResult], out: Path, failures: int) -> None:
    evaluation.write(results, out)
    print(f"wrote {out}")
    picture = out / "failures.png"
    if pictured := evaluation.draw_failures(results, failures, picture):
        print(f"wrote {picture}: {', '.join(pictured)}")


def print_skipped(evaluation: Evaluation) -> None:
    """Say which strategies cannot run, or not on all objects, and why."""
    for name, reason in evaluation.skipped.items():
        print(f"{name}: skipped: {reason}")
