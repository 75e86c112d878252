"""``bayesgrasp train``: from a data set to a model."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from bayesgrasp.data.loader import GraspDataset
    from bayesgrasp.ratio.checkpoint import Origin
    from bayesgrasp.ratio.presets import Part, Setup
    from bayesgrasp.ratio.train import Progress

    Observer = Callable[[Part, Progress], None]

FAMILIARITY_IMAGES = 1000


def train(
    data: Path,
    out: Path,
    preset: Literal["paper", "best"] = "best",
    estimators: tuple[Literal["metric", "image", "joint", "success", "full"], ...] = (),
    epochs: int = 20,
    batch_size: int = 16,
    learning_rate: float = 1e-3,
    patience: int = 5,
    criterion: Literal["nre-a", "balanced", "nre-c"] = "nre-a",
    bf16: bool = True,
    seed: int = 0,
    device: str = "cpu",
    threads: int | None = None,
    resume: bool = False,
    practice: tuple[Path, ...] = (),
    start: Path | None = None,
) -> None:
    """Train likelihood-to-evidence ratio estimators on a data set.

    A run that was killed goes on with --resume and ends with the weights of an undisturbed run. The model is written to
    --out: one file of weights per estimator and card.json, with losses and checks. Training curves for TensorBoard are
    written to --out/logs where the package `tensorboard` is installed.

    Args:
        data: Directory of a data set, from `bayesgrasp generate`.
        out: Directory of the model.
        preset: paper (the two networks of the paper) or best (success from local evidence).
        estimators: Which estimators; by default metric and image for paper, metric and success for best.
        epochs: Passes over the training scenes, at most.
        batch_size: Scenes in a batch.
        learning_rate: Peak of the schedule.
        patience: Epochs without improvement on held-out scenes before stopping; 0 never stops early.
        criterion: Loss of the likelihood-to-evidence ratios.
        bf16: Compute in bfloat16 where it is safe.
        seed: Of the weights, the order of scenes and the pairings.
        device: cpu, cuda, or cuda:N.
        threads: CPU threads; by default torch's own choice.
        resume: Go on with the run in --out, or start it where there is none.
        practice: Data sets from `bayesgrasp practice` to learn from as well.
        start: Directory of a model of the same preset whose weights training starts from.
    """
    import torch

    from bayesgrasp.cli.loading import trained_prior
    from bayesgrasp.data.loader import GraspDataset
    from bayesgrasp.ratio.checkpoint import load_model
    from bayesgrasp.ratio.fit import fit, sources, with_practice
    from bayesgrasp.ratio.losses import LossConfig
    from bayesgrasp.ratio.presets import preset as parts_of
    from bayesgrasp.ratio.train import TrainConfig

    if threads is not None:
        torch.set_num_threads(threads)
    dataset = GraspDataset(data)
    schedule = TrainConfig(epochs=epochs, learning_rate=learning_rate, patience=patience, bf16=bf16, seed=seed)
    setup = _setup(dataset)
    parts = parts_of(preset, setup, estimators or None, LossConfig(criterion), schedule)
    training, held_out = sources(dataset, batch_size, seed)
    practised = with_practice((training, held_out), [GraspDataset(p) for p in practice], batch_size, seed)
    extra = {"preset": preset, "familiarity": _familiarity(dataset)}
    with _observers(out, len(parts)) as observe:
        metrics = fit(
            parts,
            training,
            held_out,
            out,
            _origin(dataset),
            practised=practised if practice else None,
            start=load_model(start).estimators if start is not None else None,
            device=_device(device),
            resume=resume,
            callback=observe,
            prior=trained_prior({"prior": _prior(dataset)}),
            extra=extra,
        )
    _summary(metrics, out)


def _setup(dataset: GraspDataset) -> Setup:
    """What the estimators must fit, by the manifest of the data."""
    from bayesgrasp.ratio.presets import Setup

    prior = _prior(dataset)
    low, high = (tuple(float(prior[axis][end]) for axis in ("x", "y", "z")) for end in (0, 1))
    return Setup(low=low, high=high, objects=len(dataset.object_ids))  # type: ignore[arg-type]


def _prior(dataset: GraspDataset) -> dict[str, Any]:
    from bayesgrasp.errors import DataError

    prior = dataset.manifest.config.get("generate", {}).get("grasp", {})
    if not {"x", "y", "z"} <= prior.keys():
        raise DataError("the manifest of the data set does not state the prior of the hands")
    return dict(prior)


def _origin(dataset: GraspDataset) -> Origin:
    """Where the model comes from, for its card."""
    import hashlib
    import json

    from bayesgrasp.data.provenance import source_commit
    from bayesgrasp.ratio.checkpoint import Origin

    content = json.dumps([dataset.manifest.identity, dataset.manifest.totals], sort_keys=True)
    return Origin(
        gripper=dataset.manifest.gripper,
        prior=_prior(dataset),
        data=hashlib.sha256(content.encode()).hexdigest()[:16],
        commit=source_commit() or None,
        success_rate=_success_rate(dataset),
        objects=dataset.object_ids,
    )


def _success_rate(dataset: GraspDataset) -> float:
    """p(S=1) under the prior: the weighted share of successful attempts."""
    import numpy as np

    from bayesgrasp.types import Outcome

    columns = dataset.attempt_columns
    weight = np.exp(columns["log_weight"].astype(np.float64) + columns["object_log_weight"])
    return float((weight * (columns["outcome"] == Outcome.SUCCESS)).sum() / weight.sum())


def _familiarity(dataset: GraspDataset) -> dict[str, Any] | None:
    """Statistics of simulated images, by which the planner knows unfamiliar ones; None for a tiny data set."""
    import numpy as np

    from bayesgrasp.data.images import to_metres
    from bayesgrasp.errors import InvalidConfigurationError
    from bayesgrasp.geometry.camera import canonical_camera
    from bayesgrasp.posterior.familiarity import fit_familiarity
    from bayesgrasp.posterior.surface import SurfaceReader

    rows = dataset.scenes("train").rows
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), FAMILIARITY_IMAGES)).astype(int)]
    reader = SurfaceReader(canonical_camera().resized(256, 160))
    images = (to_metres(dataset.scene_columns["image"][row]) for row in rows)
    surfaces = [surface for image in images if (surface := reader.read(image)).item.any()]
    try:
        return fit_familiarity(surfaces).to_dict()
    except InvalidConfigurationError:
        return None


def _device(name: str) -> str:
    import torch

    from bayesgrasp.errors import InvalidConfigurationError

    try:
        torch.empty(0, device=name)
    except (RuntimeError, AssertionError) as error:
        raise InvalidConfigurationError(f"the device {name!r} cannot be used: {error}") from error
    return name


@contextmanager
def _observers(out: Path, parts: int) -> Iterator[Observer]:
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


def _summary(metrics: dict[str, dict[str, Any]], out: Path) -> None:
    for role, values in metrics.items():
        best = values["validation_loss"][values["best_epoch"]]
        checks = ", ".join(f"{name} {value:.4g}" for name, value in values["checks"].items())
        print(f"{role}: held-out loss {best:.4f} (epoch {values['best_epoch'] + 1}), {values['seconds']} s; {checks}")
    print(f"model written to {out}")
