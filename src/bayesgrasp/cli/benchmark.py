"""``bayesgrasp benchmark``: every strategy of the paper's table and the baselines, on the same scenes."""

from __future__ import annotations

import json as json_module
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from bayesgrasp.evaluation.journal import SceneResult
    from bayesgrasp.evaluation.runner import Benchmark, Contestants
    from bayesgrasp.evaluation.strategies import SearchConfig


def benchmark(
    model: Path | None = None,
    attempts: int = 1000,
    split: str = "train",
    ycb_dir: Path | None = None,
    mesh: Path | None = None,
    mass: float | None = None,
    seed: int = 0,
    strategies: tuple[str, ...] = (),
    starts: int = 1,
    steps: int = 20,
    engine: Literal["mujoco", "pybullet"] | None = None,
    shift: str = "none",
    workers: int = os.cpu_count() or 1,
    json: Path | None = None,
    out: Path | None = None,
    resume: bool = False,
    failures: int = 0,
) -> None:
    """Measure the success rates of the paper's strategies and of two baselines.

    All strategies meet the same scenes; nuisances are drawn anew for every scene. Success is judged by the lift test,
    and beside it whether the grasp also holds the lifted object against pushes. Grasps that the arm cannot reach are
    failures and counted apart. With --out every finished scene is kept, and a run that was interrupted goes on with
    --resume; a resumed run may have more attempts.

    Args:
        model: Directory of a trained model; by default the one that comes with the package.
        attempts: Scenes, which is attempts of each strategy; objects take turns.
        split: train, train-ycb, unseen, household, stand-ins, other, all, or one object's id.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        mesh: A mesh file to use instead (metres, z upwards); needs --mass.
        mass: Its mass, kg.
        seed: Same seed, same scenes and plans, for any number of workers.
        strategies: Which ones; by default all of them.
        starts: Ascents for each grasp type; the paper's search has 1.
        steps: Of each ascent; the paper's search has 20.
        engine: Physics of the lift test; by default that of the shift, which is MuJoCo for all but `pybullet`.
        shift: A departure from the world that the model was trained in, unknown to the planner: none, pybullet,
            mass-0.7, mass-1.3, friction-low, friction-high, stereo, scale-0.8 or scale-1.2.
        workers: Processes.
        json: Write the summary to this file.
        out: Directory for results: scenes.jsonl, summary.json, table.md, per_object.md and figures.
        resume: Go on with the run in --out, or start it where there is none.
        failures: With --out, picture this many failures of the MAP from one image: failures.png.
    """
    from bayesgrasp.evaluation.runner import Benchmark
    from bayesgrasp.evaluation.shifts import find_shift
    from bayesgrasp.evaluation.strategies import STRATEGIES
    from bayesgrasp.evaluation.tables import markdown, summarize
    from bayesgrasp.objects.catalogue import load_objects
    from bayesgrasp.ratio.checkpoint import read_card
    from bayesgrasp.workflows.load import DEFAULT_MODEL

    _check_outputs(json, out, resume, failures)
    directory = DEFAULT_MODEL if model is None else model
    card = read_card(directory)
    chosen = Benchmark(
        load_objects(split, ycb_dir, mesh, mass),
        LoadModel(directory),
        tuple(dict.fromkeys(strategies)) or STRATEGIES,
        seed,
        search_config(starts, steps),
        shift=find_shift(shift, engine),
    )
    reasons = announce_skipped(chosen, card)
    results = run_with_progress(chosen, card, attempts, workers, out, resume)
    summary = describe_run(chosen, card, split) | {"engine": chosen.shift.engine, "shift": shift}
    summary |= summarize(results, reasons)
    print(markdown(summary, split), end="")
    if json is not None:
        json.write_text(json_module.dumps(summary, indent=1) + "\n", encoding="utf-8")
    if out is not None:
        write_results(summary, out, split)
        _write_failures(chosen, results, failures, out / "failures.png")


def announce_skipped(chosen: Benchmark, card: Mapping[str, Any]) -> dict[str, str]:
    """Say which strategies cannot run, or not on all objects, and why."""
    from bayesgrasp.evaluation.runner import skipped

    reasons = skipped(chosen, card)
    for name, reason in reasons.items():
        print(f"{name}: skipped: {reason}")
    return reasons


def describe_run(chosen: Benchmark, card: Mapping[str, Any], split: str) -> dict[str, Any]:
    """Where the results of a run come from, for its summary."""
    ascent = chosen.search.ascent
    origin = {"seed": chosen.seed, "split": split, "starts": ascent.starts_per_type, "steps": ascent.steps}
    return origin | {"data": card.get("data"), "commit": card.get("commit")}


@dataclass(frozen=True)
class LoadModel:
    """Loads model and planner in a worker process; picklable.

    Attributes:
        directory: Of the model.
    """

    directory: Path

    def __call__(self) -> Contestants:
        """Load them."""
        from bayesgrasp.evaluation.runner import Contestants
        from bayesgrasp.ratio.checkpoint import load_model
        from bayesgrasp.workflows.load import load_planner

        return Contestants(load_model(self.directory), load_planner(self.directory))


def run_with_progress(
    chosen: Benchmark,
    card: dict[str, Any],
    attempts: int,
    workers: int,
    out: Path | None,
    resume: bool,
    known: Sequence[SceneResult] = (),
) -> tuple[SceneResult, ...]:
    """Run a benchmark under a progress bar, with a journal in ``out``; ``known`` as `runner.run` takes it."""
    from bayesgrasp.evaluation.journal import Journal
    from bayesgrasp.evaluation.runner import run

    journal = None if out is None else Journal(out, chosen.identity(card), resume)
    with _progress(attempts, chosen.shift.name) as advance:
        return run(chosen, attempts, workers, journal, advance, known)


def write_results(summary: dict[str, Any], out: Path, split: str) -> None:
    """Summary, tables and figures of a finished run."""
    from bayesgrasp.evaluation.figures import plot_ladder, plot_per_object
    from bayesgrasp.evaluation.tables import markdown, markdown_per_object

    (out / "summary.json").write_text(json_module.dumps(summary, indent=1) + "\n", encoding="utf-8")
    (out / "table.md").write_text(markdown(summary, split), encoding="utf-8")
    (out / "per_object.md").write_text(markdown_per_object(summary), encoding="utf-8")
    plot_ladder(summary, out / "ladder.png", split)
    plot_per_object(summary, out / "per_object.png")
    print(f"wrote {out}")


def search_config(starts: int, steps: int) -> SearchConfig:
    """The search of all strategies; arguments as in `benchmark`."""
    from bayesgrasp.evaluation.strategies import SearchConfig
    from bayesgrasp.posterior.ascent import AscentConfig

    return SearchConfig(ascent=AscentConfig(starts_per_type=starts, steps=steps))


def _check_outputs(json: Path | None, out: Path | None, resume: bool, failures: int) -> None:
    """Refuse before the work, not after it."""
    from bayesgrasp.errors import InvalidConfigurationError

    if json is not None and not json.resolve().parent.is_dir():
        raise InvalidConfigurationError(f"cannot write {json}: there is no directory {json.resolve().parent}")
    if out is None and (resume or failures):
        raise InvalidConfigurationError("--resume and --failures need the directory of the run: give --out")


def _write_failures(chosen: Benchmark, results: tuple[SceneResult, ...], count: int, path: Path) -> None:
    """Rows of frames of failed grasps that reached physics; objects take turns, the most often failed ones first."""
    from PIL import Image

    from bayesgrasp.types import Outcome
    from bayesgrasp.viewer.film import film_sheet

    name = "map_image"
    moved = {outcome.name.lower() for outcome in (Outcome.NO_CONTACT, Outcome.DROPPED)}
    failed = [r for r in results if name in r.trials and r.trials[name].outcome in moved]
    by_object = [[r for r in failed if r.object == item] for item in dict.fromkeys(r.object for r in failed)]
    by_object.sort(key=len, reverse=True)
    turns = [r for turn in zip_longest(*by_object) for r in turn if r is not None]
    attempts = [a for r in turns[:count] if (a := r.attempt(name)) is not None]
    if attempts:
        config = chosen.shift.lift_test_config
        Image.fromarray(film_sheet(chosen.objects, attempts, config=config)).save(path)
        print(f"wrote {path}: {', '.join(chosen.objects[int(a.object_index[0])].id for a in attempts)}")


@contextmanager
def _progress(total: int, shift: str) -> Iterator[Callable[[SceneResult], None]]:
    """A progress bar over scenes, with the successes of the MAP from one image so far."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    title = "scenes" if shift == "none" else f"scenes, {shift}"
    columns = (TextColumn(title), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[found]}"))
    counts: dict[str, list[int]] = {}
    with Bar(*columns, TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()) as bar:
        task = bar.add_task("", total=total, found="")

        def advance(result: SceneResult) -> None:
            for name, trial in result.trials.items():
                done = counts.setdefault(name, [0, 0])
                done[0] += trial.success
                done[1] += 1
            name = "map_image" if "map_image" in counts else next(iter(counts), "")
            found = f"{name} {counts[name][0]}/{counts[name][1]}" if name else ""
            bar.update(task, advance=1, found=found)

        yield advance
