"""From a data set to a model directory: trains the parts of a preset one after another and checks each.

Every part keeps its state below ``out/state``, so a killed run goes on with the part it was in; the card is written
last.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from bayesgrasp.data.loader import GraspDataset, SceneLoader
from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import CheckpointError, DataError
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.ratio.card import CARD
from bayesgrasp.ratio.checkpoint import Origin, save_model
from bayesgrasp.ratio.kinds import build
from bayesgrasp.ratio.model import POWER
from bayesgrasp.ratio.tensor_file import load_weights
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.training.checks import check
from bayesgrasp.training.power import posterior_power
from bayesgrasp.training.presets import Part
from bayesgrasp.training.train_estimator import Progress, Source, train

STATE = "state"

Sources = tuple[Source, Source]
"""Batches to learn from, and batches of held-out draws."""


@dataclass(frozen=True)
class WholeBatches:
    """The batches of a loader without a smaller last one, unless it is the only one.

    Attributes:
        loader: Of a split.
    """

    loader: SceneLoader

    def __len__(self) -> int:
        """Batches in an epoch."""
        return max(len(self.loader.rows) // self.loader.batch_size, min(1, len(self.loader)))

    def __call__(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch."""
        return (batch for batch, _ in zip(self.loader(epoch), range(len(self)), strict=False))


@dataclass(frozen=True)
class Together:
    """The batches of several sources, in an order that depends on seed and epoch alone.

    Attributes:
        parts: The sources.
        seed: Of the order.
    """

    parts: tuple[Source, ...]
    seed: int

    def __len__(self) -> int:
        """Batches in an epoch."""
        return sum(len(part) for part in self.parts)

    def __call__(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch."""
        turns = np.repeat(np.arange(len(self.parts)), [len(part) for part in self.parts])
        streams = [part(epoch) for part in self.parts]
        return (next(streams[turn]) for turn in generator(self.seed, Stream.TURNS, epoch).permutation(turns))


def sources(dataset: GraspDataset, batch_size: int, seed: int, objects: int | None = None) -> Sources:
    """Training and held-out batches; the split is by object draw.

    Args:
        dataset: Of scenes.
        batch_size: Scenes in a batch.
        seed: Of their order.
        objects: Only scenes of so many meshes, the first ones of the data set; of all if None.

    Raises:
        DataError: One of them would be empty.
    """
    loaders = [dataset.scenes(split, batch_size, seed, split == "train") for split in ("train", "validation")]
    if objects is not None:
        loaders = [replace(a, rows=a.rows[a.columns["object_index"][a.rows] < objects]) for a in loaders]
    for loader, name in zip(loaders, ("training", "held-out"), strict=True):
        if len(loader.rows) < 2:
            raise DataError(
                f"the data set has {len(loader.rows)} {name} scenes; at least two are needed: generate more"
            )
    return WholeBatches(loaders[0]), WholeBatches(loaders[1])


def with_practice(
    base: Sources,
    practice: Sequence[GraspDataset],
    batch_size: int,
    seed: int,
    known: tuple[str, ...] | None = None,
) -> Sources:
    """Training and held-out batches of a data set together with those of practice on it (`generation.practice`).

    Args:
        base: Of the data set.
        practice: Sets of practice; without any, the base as it is.
        batch_size: Scenes in a batch.
        seed: Of their order.
        known: Only practice on these meshes, for an estimator that is told the mesh; on all of them if None.

    Raises:
        DataError: A set of practice has other meshes in these places, so an index would mean two things.
    """
    if not practice:
        return base
    for dataset in practice:
        if known is not None and dataset.object_ids[: len(known)] != known:
            raise DataError(
                f"{dataset.store.directory} was practised on other objects than the data set's: an estimator that is "
                "told the object cannot learn from it"
            )
    more = [sources(dataset, batch_size, seed, None if known is None else len(known)) for dataset in practice]
    return Together((base[0], *(m[0] for m in more)), seed), Together((base[1], *(m[1] for m in more)), seed)


def fit(
    parts: Sequence[Part],
    sources_of: Callable[[Part], Sources],
    out: Path,
    origin: Origin,
    *,
    start: Mapping[str, nn.Module] | None = None,
    device: torch.device | str = "cpu",
    resume: bool = False,
    callback: Callable[[Part, Progress], None] | None = None,
    prior: GraspPrior | None = None,
    extra: dict[str, Any] | None = None,
) -> dict[str, dict[str, Any]]:
    """Train the parts and write the model.

    Args:
        parts: Of a preset.
        sources_of: Batches to learn from and batches of held-out draws, for each part.
        out: Directory of the model.
        origin: For the card.
        start: Trained estimators by role whose weights a part of the same role and shape starts from.
        device: Where to train.
        resume: Go on with a run that was interrupted; without it, a directory with a run in it is refused.
        callback: Told after every step.
        prior: p(h); with it, the power of p(S=1 | i, h) is fitted on the held-out scenes (`power.py`).
        extra: More entries of the card.

    Returns:
        Metrics by role, as in the card.

    Raises:
        CheckpointError: There is a run in `out` already, or its state is of another run.
    """
    if not resume and ((out / STATE).exists() or (out / CARD).exists()):
        raise CheckpointError(f"{out} holds a run already: give --resume to go on with it, or another directory")
    estimators: dict[str, nn.Module] = {}
    metrics: dict[str, dict[str, Any]] = {}
    for part in parts:
        training, held_out = sources_of(part)
        estimators[part.role], metrics[part.role] = _fit_part(
            part, training, held_out, out, device, callback, (start or {}).get(part.role)
        )
        if prior is not None and part.role == "success":
            power = posterior_power(estimators[part.role], held_out(0), prior)
            extra = {**(extra or {}), POWER: {part.role: power}}
    save_model(out, estimators, origin, metrics, extra)
    return metrics


def _fit_part(
    part: Part,
    training: Source,
    held_out: Source,
    out: Path,
    device: torch.device | str,
    callback: Callable[[Part, Progress], None] | None,
    start: nn.Module | None,
) -> tuple[nn.Module, dict[str, Any]]:
    def begin() -> nn.Module:
        estimator = build(part.kind, part.config)
        if start is not None:
            load_weights(estimator, start.state_dict(), f"the {part.role} estimator to start from")
        return estimator

    result = train(
        begin,
        part.objective,
        training,
        held_out,
        part.train,
        device=device,
        state_file=out / STATE / f"{part.role}.safetensors",
        resume=True,
        callback=None if callback is None else lambda progress: callback(part, progress),
    )
    history = {"train_loss": result.train, "validation_loss": result.validation, "best_epoch": result.best_epoch}
    schedule = {"stopped": result.stopped, "seconds": round(result.seconds, 1), "schedule": asdict(part.train)}
    checks = check(result.estimator, part.objective, held_out(0), part.train.seed)
    return result.estimator, {**history, **schedule, "checks": checks}
