"""What is seen of a training run: a bar, TensorBoard's log where it is installed, and the summary at its end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bayesgrasp.training.presets import Part
    from bayesgrasp.training.train_estimator import Progress

    Observer = Callable[[Part, Progress], None]


@contextmanager
def observers(out: Path, parts: int) -> Iterator[Observer]:
    """Everything that watches a run: the progress bar, and TensorBoard's log where it is installed."""
    with ExitStack() as stack:
        observers = [stack.enter_context(_bar(parts))]
        if (log := _tensorboard(out / "logs")) is not None:
            observers.append(stack.enter_context(log))

        def observe(part: Part, progress: Progress) -> None:
            for observer in observers:
                observer(part, progress)

        yield observe


@contextmanager
def _bar(parts: int) -> Iterator[Observer]:
    """A bar per estimator: step, losses, time left."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description:8}"),
        BarColumn(20),
        MofNCompleteColumn(),
        TextColumn("{task.fields[loss]}"),
    )
    tasks: dict[str, Any] = {}
    smooth: dict[str, float] = {}
    held_out: dict[str, str] = {}
    with Bar(*columns, TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()) as bar:

        def observe(part: Part, progress: Progress) -> None:
            role = part.role
            if role not in tasks:
                tasks[role] = bar.add_task(role, total=progress.epochs * progress.steps, loss="")
            smooth[role] = 0.98 * smooth.get(role, progress.loss) + 0.02 * progress.loss
            if progress.validation is not None:
                held_out[role] = f", held out {progress.validation:.4f} after epoch {progress.epoch + 1}"
            done = progress.epoch * progress.steps + progress.step + 1
            bar.update(tasks[role], completed=done, loss=f"loss {smooth[role]:.4f}{held_out.get(role, '')}")

        yield observe


def _tensorboard(directory: Path) -> Any:
    """A context that gives an observer writing scalars; None where the package is absent."""
    import importlib.util

    if importlib.util.find_spec("tensorboard") is None:
        return None
    return _scalars(directory)


@contextmanager
def _scalars(directory: Path) -> Iterator[Observer]:
    from torch.utils.tensorboard import SummaryWriter

    writer = SummaryWriter(str(directory))

    def observe(part: Part, progress: Progress) -> None:
        count = progress.epoch * progress.steps + progress.step
        writer.add_scalar(f"{part.role}/loss", progress.loss, count)
        writer.add_scalar(f"{part.role}/learning_rate", progress.learning_rate, count)
        if progress.validation is not None:
            writer.add_scalar(f"{part.role}/held_out", progress.validation, count)

    try:
        yield observe
    finally:
        writer.close()


def print_summary(metrics: dict[str, dict[str, Any]], out: Path) -> None:
    """Losses and checks of every estimator."""
    for role, values in metrics.items():
        best = values["validation_loss"][values["best_epoch"]]
        checks = ", ".join(f"{name} {value:.4g}" for name, value in values["checks"].items())
        print(f"{role}: held-out loss {best:.4f} (epoch {values['best_epoch'] + 1}), {values['seconds']} s; {checks}")
    print(f"model written to {out}")
