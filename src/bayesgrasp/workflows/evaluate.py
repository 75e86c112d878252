"""A model's strategies judged by the lift test: ``bayesgrasp benchmark``, and under shifts ``bayesgrasp transfer``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

from bayesgrasp.diagnostics.plots import save
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.figures import plot_ladder, plot_per_object, plot_transfer
from bayesgrasp.evaluation.journal import Journal, SceneResult
from bayesgrasp.evaluation.runner import Benchmark, Contestants, run, skipped
from bayesgrasp.evaluation.shifts import NONE, SHIFTS, Shift, find_shift
from bayesgrasp.evaluation.strategies import STRATEGIES, SearchConfig
from bayesgrasp.evaluation.tables import markdown, markdown_per_object, promises_of, summarize
from bayesgrasp.evaluation.transfer import markdown_transfer, summarize_transfer
from bayesgrasp.files import write_json, write_text
from bayesgrasp.locks import sole_writer
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.prior.cameras import AnyCamera
from bayesgrasp.ratio.card import read_card
from bayesgrasp.types import Attempts, Outcome
from bayesgrasp.viewer.film import save_film
from bayesgrasp.workflows.load import load_planner, load_trained

PICTURED = "map_image"
"""The strategy whose failures are pictured."""
REACHED_PHYSICS = frozenset(outcome.name.lower() for outcome in (Outcome.NO_CONTACT, Outcome.DROPPED))


@dataclass(frozen=True)
class ModelContestants:
    """Model and planner of a directory, loaded in the process that uses them.

    Attributes:
        directory: Of the model.
    """

    directory: Path

    def load(self) -> Contestants:
        """Load them."""
        return Contestants(load_trained(self.directory), load_planner(self.directory))


@dataclass(frozen=True)
class Evaluation:
    """A benchmark of a trained model.

    Attributes:
        benchmark: What is run.
        card: Of the model.
        split: What the objects are called in tables.
    """

    benchmark: Benchmark
    card: Mapping[str, Any]
    split: str = "train"

    @staticmethod
    def of(
        model: Path,
        objects: tuple[ObjectAsset, ...],
        split: str = "train",
        *,
        strategies: Sequence[str] = (),
        seed: int = 0,
        search: SearchConfig | None = None,
        shift: Shift = NONE,
    ) -> Evaluation:
        """The benchmark of a model on disk.

        Args:
            model: Its directory.
            objects: The object set.
            split: What the objects are called in tables.
            strategies: Which ones; all of them if empty.
            seed: Same seed, same scenes and plans.
            search: Of the optimising strategies; the paper's by default.
            shift: How the world departs from the one that the model was trained in.

        Raises:
            CheckpointError: There is no such model.
            InvalidConfigurationError: No objects, or an unknown strategy.
        """
        card, names = read_card(model), tuple(dict.fromkeys(strategies)) or STRATEGIES
        load = ModelContestants(model).load
        return Evaluation(Benchmark(objects, load, names, seed, search or SearchConfig(), shift=shift), card, split)

    @property
    def skipped(self) -> dict[str, str]:
        """Strategies that cannot run, or not on all objects, and why, in words."""
        return skipped(self.benchmark, self.card)

    def under(self, shift: Shift) -> Evaluation:
        """The same in a world that departs from the model's."""
        return replace(self, benchmark=replace(self.benchmark, shift=shift))

    def seen_from(self, cameras: AnyCamera) -> Evaluation:
        """The same with images from other cameras."""
        priors = replace(self.benchmark.priors, camera=cameras)
        return replace(self, benchmark=replace(self.benchmark, priors=priors))

    def run(
        self,
        attempts: int,
        workers: int = 1,
        out: Path | None = None,
        *,
        resume: bool = False,
        progress: Callable[[SceneResult], None] | None = None,
        known: Sequence[SceneResult] = (),
    ) -> tuple[SceneResult, ...]:
        """Run scenes 0 to ``attempts`` - 1.

        Args:
            attempts: Scenes, which is attempts of each strategy; objects take turns.
            workers: Processes; the results do not depend on their number.
            out: Directory where every finished scene is kept.
            resume: Go on with the run in ``out``, or start it where there is none.
            progress: Told every finished scene, in any order; also those that were there.
            known: Results without the shift; hands that the shift cannot change are taken from them.

        Raises:
            FileError: Another process is writing to ``out``, or the disk is full.
            DataError: There is a run in ``out`` already, or another one.
        """
        if out is None:
            return run(self.benchmark, attempts, workers, None, progress, known)
        with sole_writer(out):
            journal = Journal(out, self.benchmark.identity(self.card), resume)
            return run(self.benchmark, attempts, workers, journal, progress, known)

    @property
    def origin(self) -> dict[str, Any]:
        """Where the results of a run come from."""
        ascent = self.benchmark.search.ascent
        settings = {"seed": self.benchmark.seed, "split": self.split}
        settings |= {"starts": ascent.starts_per_type, "steps": ascent.steps}
        return settings | {"data": self.card.get("data"), "commit": self.card.get("commit")}

    def summary(self, results: Sequence[SceneResult]) -> dict[str, Any]:
        """Rates, intervals and differences of a run with where they come from, as JSON-able data."""
        shift = self.benchmark.shift
        return self.origin | {"engine": shift.engine, "shift": shift.name} | summarize(results, self.skipped)

    def write(self, results: Sequence[SceneResult], out: Path) -> dict[str, Any]:
        """Summary, tables and figures of a run; returns the summary."""
        summary = self.summary(results)
        write_json(out / "summary.json", summary)
        write_text(out / "table.md", markdown(summary, self.split))
        write_text(out / "per_object.md", markdown_per_object(summary))
        plot_ladder(summary, out / "ladder.png", self.split)
        plot_per_object(summary, out / "per_object.png")
        if (kept := promises_of(result.trials["plan"] for result in results if "plan" in result.trials)) is not None:
            save(kept.draw(), out / "promises.png")
        return summary

    def draw_failures(self, results: Sequence[SceneResult], count: int, path: Path) -> tuple[str, ...]:
        """Frames of failed grasps that reached physics, a row each; returns the objects, none where nothing is drawn.

        Objects take turns, the most often failed ones first.
        """
        attempts = _failed(results, count)
        if attempts:
            objects, config = self.benchmark.objects, self.benchmark.shift.lift_test_config
            save_film(path, objects, attempts, config)
        return tuple(self.benchmark.objects[int(attempt.object_index[0])].id for attempt in attempts)


def _failed(results: Sequence[SceneResult], count: int) -> list[Attempts]:
    failed = [r for r in results if PICTURED in r.trials and r.trials[PICTURED].outcome in REACHED_PHYSICS]
    by_object = [[r for r in failed if r.object == item] for item in dict.fromkeys(r.object for r in failed)]
    by_object.sort(key=len, reverse=True)
    turns = [r for turn in zip_longest(*by_object) for r in turn if r is not None]
    return [attempt for r in turns[:count] if (attempt := r.attempt(PICTURED)) is not None]


@dataclass
class Transfer:
    """What strategies lose when the world is not the one that the model was trained in.

    Every shift meets the same scenes with the same random numbers, and is a benchmark of its own in ``out/SHIFT``.

    Attributes:
        evaluation: In the model's own world.
        out: Directory of all results.
        results: Those of the shifts so far, by name.
    """

    evaluation: Evaluation
    out: Path
    results: dict[str, tuple[SceneResult, ...]] = field(default_factory=dict)

    def run(
        self,
        shift: Shift,
        attempts: int,
        workers: int = 1,
        *,
        resume: bool = False,
        progress: Callable[[SceneResult], None] | None = None,
    ) -> Path:
        """Run one shift, `NONE` first; returns the directory of its results. Arguments as of `Evaluation.run`."""
        shifted, out = self.evaluation.under(shift), self.out / shift.name
        known = self.results.get(NONE.name, ())
        found = shifted.run(attempts, workers, out, resume=resume, progress=progress, known=known)
        self.results[shift.name] = found
        shifted.write(found, out)
        return out

    def write(self) -> dict[str, Any]:
        """Losses of every strategy under every shift, as JSON, table and figure; returns the summary."""
        summary = {**self.evaluation.origin, "skipped": self.evaluation.skipped, **summarize_transfer(self.results)}
        write_json(self.out / "transfer.json", summary)
        write_text(self.out / "transfer.md", markdown_transfer(summary))
        plot_transfer(summary, self.out / "transfer.png")
        return summary


def shifts_named(names: Sequence[str]) -> tuple[Shift, ...]:
    """The shifts of a transfer, none first; all of them where no name is given.

    Raises:
        InvalidConfigurationError: There is no such shift, or none but `none`.
    """
    shifts = tuple(find_shift(name) for name in dict.fromkeys((NONE.name, *(names or SHIFTS))))
    if shifts == (NONE,):
        raise InvalidConfigurationError("nothing can be lost without a shift: name another than none")
    return shifts
