"""Bars on the terminal: how far the work of a command is, what it found, how long it takes and will take."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.progress import (
    BarColumn,
    DownloadColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
    TransferSpeedColumn,
)

if TYPE_CHECKING:  # what is watched, each by one command
    from torch.utils.tensorboard import SummaryWriter

    from bayesgrasp.evaluation.journal import SceneResult
    from bayesgrasp.generation.run import Progress as Generated
    from bayesgrasp.generation.trials import Trials
    from bayesgrasp.training.presets import Part
    from bayesgrasp.training.train_estimator import Progress as Step
    from bayesgrasp.training.train_model import Watch

Report = Callable[[int, int | None], None]
"""Told how many bytes are there, and of how many."""


class Bars:
    """A bar for each of some tasks, shown inside a ``with`` block."""

    def __init__(self) -> None:
        title, note = TextColumn("{task.description:10}"), TextColumn("{task.fields[note]}")
        times = TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()
        self.progress = Progress(title, BarColumn(20), MofNCompleteColumn(), note, *times)
        self.tasks: dict[str, TaskID] = {}

    def __enter__(self) -> Bars:
        self.progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.progress.stop()

    def show(self, name: str, done: int, total: int, note: str = "") -> None:
        """Say how much of a task is done, and what was found."""
        if name not in self.tasks:
            self.tasks[name] = self.progress.add_task(name, total=total, note="")
        self.progress.update(self.tasks[name], completed=min(done, total), note=note)

    def elapsed(self, name: str) -> float:
        """Seconds since a task was first shown; 0 before."""
        return (self.progress.tasks[self.tasks[name]].elapsed or 0.0) if name in self.tasks else 0.0


@contextmanager
def counting(name: str, total: int) -> Iterator[Callable[[int], None]]:
    """Work that is counted: posteriors judged, successes found."""
    with Bars() as bars:
        bars.show(name, 0, total)
        yield lambda done: bars.show(name, done, total)


@contextmanager
def generating(total: int) -> Iterator[Callable[[Generated], None]]:
    """Attempts of a data set, with successes, images and the rate."""
    with Bars() as bars:

        def show(progress: Generated) -> None:
            elapsed = bars.elapsed("attempts")
            rate = f"{progress.made / elapsed:.0f}/s" if progress.made and elapsed > 0 else "-/s"
            note = f"{progress.successes} successes, {progress.scenes} images, {rate}"
            bars.show("attempts", progress.attempts, total, note)

        yield show


@contextmanager
def lift_testing(total: int) -> Iterator[Callable[[Trials], None]]:
    """Lift tests, with the number of successes so far."""
    done = found = 0
    with Bars() as bars:

        def show(trials: Trials) -> None:
            nonlocal done, found
            done += len(trials.outcomes)
            found += trials.successes
            bars.show("lift tests", done, total, f"{found} successes")

        yield show


@contextmanager
def benchmarking(total: int, shift: str = "none") -> Iterator[Callable[[SceneResult], None]]:
    """Scenes, with the successes of the MAP from one image so far, or of the first strategy."""
    title = "scenes" if shift == "none" else f"scenes, {shift}"
    counts: dict[str, list[int]] = {}
    done = 0
    with Bars() as bars:
        bars.show(title, 0, total)

        def show(result: SceneResult) -> None:
            nonlocal done
            done += 1
            for name, trial in result.trials.items():
                count = counts.setdefault(name, [0, 0])
                count[0] += trial.success
                count[1] += 1
            name = "map_image" if "map_image" in counts else next(iter(counts), "")
            bars.show(title, done, total, f"{name} {counts[name][0]}/{counts[name][1]}" if name else "")

        yield show


@contextmanager
def training(out: Path) -> Iterator[Watch]:
    """A bar for each estimator with its losses, and TensorBoard's log in ``out/logs`` where it is installed."""
    with ExitStack() as stack:
        watchers: list[Watch] = [_losses(stack.enter_context(Bars()))]
        if importlib.util.find_spec("tensorboard") is not None:
            watchers.append(_scalars(out / "logs", stack))

        def show(part: Part, step: Step) -> None:
            for watcher in watchers:
                watcher(part, step)

        yield show


def _losses(bars: Bars) -> Watch:
    smooth: dict[str, float] = {}
    held_out: dict[str, str] = {}

    def show(part: Part, step: Step) -> None:
        role = part.role
        smooth[role] = 0.98 * smooth.get(role, step.loss) + 0.02 * step.loss
        if step.validation is not None:
            held_out[role] = f", held out {step.validation:.4f} after epoch {step.epoch + 1}"
        done = step.epoch * step.steps + step.step + 1
        bars.show(role, done, step.epochs * step.steps, f"loss {smooth[role]:.4f}{held_out.get(role, '')}")

    return show


def _scalars(directory: Path, stack: ExitStack) -> Watch:
    """Writes TensorBoard's scalars, from the first step on: a run that is refused leaves no log."""
    from torch.utils.tensorboard import SummaryWriter

    writers: list[SummaryWriter] = []

    def show(part: Part, step: Step) -> None:
        if not writers:
            writers.append(SummaryWriter(str(directory)))
            stack.callback(writers[0].close)
        count = step.epoch * step.steps + step.step
        writers[0].add_scalar(f"{part.role}/loss", step.loss, count)
        writers[0].add_scalar(f"{part.role}/learning_rate", step.learning_rate, count)
        if step.validation is not None:
            writers[0].add_scalar(f"{part.role}/held_out", step.validation, count)

    return show


@contextmanager
def downloading() -> Iterator[Callable[[str], Report]]:
    """Files, one after the other, with their bytes and the speed; each new one takes the place of the last."""
    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TransferSpeedColumn())
    with Progress(*columns, transient=True) as progress:

        def begin(name: str) -> Report:
            for task in progress.task_ids:
                progress.remove_task(task)
            return partial(_downloaded, progress, progress.add_task(name, total=None))

        yield begin


def _downloaded(progress: Progress, task: TaskID, done: int, total: int | None) -> None:
    progress.update(task, completed=done, total=total)
