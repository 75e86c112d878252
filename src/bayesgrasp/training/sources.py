"""What an estimator learns from, and what it is validated on: batches by epoch, of one data set or of several.

A source gives the same batches, in the same order, whenever an epoch is asked for again, so a run that was killed goes
on where it was.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from bayesgrasp.data.attempts import PractisedAttempts
from bayesgrasp.data.loader import GraspDataset, SceneLoader
from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import DataError
from bayesgrasp.seeding import Stream, generator


@runtime_checkable
class Source(Protocol):
    """Batches by epoch: the same ones, in the same order, whenever an epoch is asked for again."""

    def __len__(self) -> int:
        """Batches in an epoch."""
        ...

    def batches(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch, counted from 0."""
        ...


@dataclass(frozen=True)
class Sources:
    """The data of one estimator.

    Attributes:
        training: To learn from.
        held_out: Draws that are never learned from, for early stopping and for the checks; epoch 0 of them is used.
        identity: A name for the very data; a saved state of training goes on with no other. Empty where nothing is
            saved.
    """

    training: Source
    held_out: Source
    identity: str = ""


@dataclass(frozen=True)
class FullBatches:
    """The batches of a loader without a smaller last one, unless it is the only one.

    Attributes:
        loader: Of a split.
    """

    loader: SceneLoader

    def __len__(self) -> int:
        """Batches in an epoch."""
        return max(len(self.loader.rows) // self.loader.batch_size, min(1, len(self.loader)))

    def batches(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch."""
        return (batch for batch, _ in zip(self.loader.batches(epoch), range(len(self)), strict=False))


@dataclass(frozen=True)
class InterleavedSources:
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

    def batches(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch."""
        turns = np.repeat(np.arange(len(self.parts)), [len(part) for part in self.parts])
        streams = [part.batches(epoch) for part in self.parts]
        return (next(streams[turn]) for turn in generator(self.seed, Stream.TURNS, epoch).permutation(turns))


def scene_sources(dataset: GraspDataset, batch_size: int, seed: int, objects: int | None = None) -> Sources:
    """Training and held-out scenes of a data set; the split is by object draw.

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
    return Sources(FullBatches(loaders[0]), FullBatches(loaders[1]))


def with_practice(
    base: Sources,
    practice: Sequence[GraspDataset],
    batch_size: int,
    seed: int,
    known: tuple[str, ...] | None = None,
) -> Sources:
    """Training and held-out scenes of a data set together with those of practice on it (`generation.practice`).

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
    every = [base, *(scene_sources(one, batch_size, seed, None if known is None else len(known)) for one in practice)]
    return Sources(
        InterleavedSources(tuple(one.training for one in every), seed),
        InterleavedSources(tuple(one.held_out for one in every), seed),
    )


def with_blind_practice(base: Sources, practice: Sequence[GraspDataset], seed: int) -> Sources:
    """Training and held-out attempts together with those of practice that saw nothing (`generation.blind_practice`).

    Args:
        base: Attempts of a data set.
        practice: Sets of practice; without any, the base as it is.
        seed: Of the order of the attempts.
    """
    if not practice:
        return base
    columns = [dataset.attempt_columns for dataset in practice]
    training = (PractisedAttempts(one, "train", seed=seed) for one in columns)
    held_out = (PractisedAttempts(one, "validation", seed=seed) for one in columns)
    return Sources(
        InterleavedSources((base.training, *training), seed), InterleavedSources((base.held_out, *held_out), seed)
    )
