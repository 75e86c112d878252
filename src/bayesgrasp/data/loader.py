"""From a data set to shuffled batches, with bounded memory.

Splits are by object draw, so no scene, no attempt and no pair of one draw is in two splits: of every 20 draws the first
validates, the second tests, the others train. Draws are independent and alike, so their number is as good as chance.

The sensor's noise is not drawn afresh each epoch: that would cost an image its whole rendering again (some 2 ms, about
what a training step spends on it), for which a new scene with new poses, camera and noise can be had instead.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from jaxtyping import Int64

from bayesgrasp.data.cache import Columns, unpacked
from bayesgrasp.data.images import to_metres
from bayesgrasp.data.manifest import Manifest, fingerprint
from bayesgrasp.data.schema import Batch, success_of
from bayesgrasp.data.shards import HAND, hands_of, read_attempts, read_table, scenes_of
from bayesgrasp.data.store import Store
from bayesgrasp.errors import DataError, InvalidConfigurationError
from bayesgrasp.geometry.hand_arrays import hands_from
from bayesgrasp.seeding import Stream, generator

Split = Literal["train", "validation", "test", "all"]
CYCLE, VALIDATION, TEST = 20, 0, 1
BLOCK, WINDOW = 1024, 64
"""Attempts are shuffled as blocks of rows, and again inside windows of blocks: memory does not grow with the set."""


class GraspDataset:
    """A finished or growing data set, read-only.

    Args:
        directory: Where `generate` wrote it.
        cache: Where its arrays are unpacked; ``directory/cache`` unless given.

    Raises:
        DataError: There is none, it is empty, damaged, or of another schema.
    """

    def __init__(self, directory: Path | str, cache: Path | str | None = None) -> None:
        self.store = Store(Path(directory))
        self.manifest: Manifest = self.store.manifest()
        self.entries = self.store.entries()
        if not self.entries:
            raise DataError(f"{directory} holds no finished chunk yet; run `generate --resume`")
        found = sum(entry.attempts for entry in self.entries.values())
        if found < self.manifest.totals.get("attempts", 0):
            raise DataError(
                f"{directory} has lost chunks: its journal names {found} attempts, its manifest "
                f"{self.manifest.totals['attempts']}; run `generate --resume` to make them again"
            )
        self.cache = Path(cache) if cache is not None else Path(directory) / "cache"

    @property
    def fingerprint(self) -> str:
        """A name for the very data; that of a set with more, other or altered chunks is another."""
        return fingerprint(self.manifest, self.entries)

    @property
    def object_ids(self) -> tuple[str, ...]:
        """What `object_index` refers to, in order."""
        return tuple(item["id"] for item in self.manifest.objects)

    @property
    def images(self) -> int:
        """How many scenes there are; a set of attempts alone has none."""
        return sum(entry.scenes for entry in self.entries.values())

    @cached_property
    def scene_columns(self) -> Columns:
        """All scenes as memory maps, hands with the prefix ``hand_``; see `SceneRecords` and `HandRecords`."""
        rows = self.images
        if rows == 0:
            raise DataError(f"{self.store.directory} has no images; generate with --scenes-per-draw 1 or more")
        return unpacked(self.cache, "scenes", self.entries.values(), rows, self._read_scenes)

    @cached_property
    def attempt_columns(self) -> Columns:
        """All attempts as memory maps; see `AttemptRecords`."""
        rows = sum(entry.attempts for entry in self.entries.values())
        return unpacked(self.cache, "attempts", self.entries.values(), rows, self._read_attempts)

    def scenes(self, split: Split = "train", batch_size: int = 64, seed: int = 0, shuffle: bool = True) -> SceneLoader:
        """Batches of scenes with their images and hands."""
        rows = np.flatnonzero(in_split(self.scene_columns["draw"], split))
        return SceneLoader(self.scene_columns, rows, batch_size, seed, shuffle)

    def attempts(
        self, split: Split = "train", batch_size: int = 4096, seed: int = 0, shuffle: bool = True
    ) -> AttemptLoader:
        """Batches of attempts as they were made, as scenes of one hand without an image."""
        return AttemptLoader(self.attempt_columns, split, batch_size, seed, shuffle)

    def _read_attempts(self, chunk: int) -> Columns:
        path, sha256 = self.store.path("attempts", chunk), self.entries[chunk].sha256[0]
        return read_attempts(path, chunk, sha256).columns()

    def _read_scenes(self, chunk: int) -> Columns:
        table = read_table(self.store.path("scenes", chunk), chunk, self.entries[chunk].sha256[1])
        hands = {HAND + name: column for name, column in hands_of(table).columns().items()}
        return scenes_of(table).columns() | hands


def in_split(draw: Int64[np.ndarray, "n"], split: Split) -> np.ndarray:
    """Which rows belong to a split, by the number of their draw; shape (n,), bool.

    Raises:
        InvalidConfigurationError: There is no such split.
    """
    place = np.asarray(draw) % CYCLE
    chosen: np.ndarray
    match split:
        case "validation":
            chosen = place == VALIDATION
        case "test":
            chosen = place == TEST
        case "train":
            chosen = (place != VALIDATION) & (place != TEST)
        case "all":
            chosen = np.ones(len(place), dtype=bool)
        case _:
            raise InvalidConfigurationError(f"the splits are train, validation, test and all; got {split!r}")
    return chosen


@dataclass(frozen=True)
class SceneLoader:
    """Batches of scenes: ``loader.batches(epoch)`` yields the same batches whenever it is asked for that epoch.

    Attributes:
        columns: See `GraspDataset.scene_columns`.
        rows: The scenes of the split.
        batch_size: Scenes in a batch; the last one may be smaller.
        seed: Of the order.
        shuffle: A new order every epoch, or the stored one.
    """

    columns: Columns
    rows: Int64[np.ndarray, "n"]
    batch_size: int
    seed: int = 0
    shuffle: bool = True

    def __post_init__(self) -> None:
        if self.batch_size < 1:
            raise InvalidConfigurationError(f"batch_size must be at least 1, got {self.batch_size}")

    def __len__(self) -> int:
        """Batches of an epoch."""
        return -(-len(self.rows) // self.batch_size)

    def batches(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch."""
        order = self.rows
        if self.shuffle:
            order = generator(self.seed, Stream.SCENE_ORDER, epoch).permutation(self.rows)
        for start in range(0, len(order), self.batch_size):
            yield self.batch(order[start : start + self.batch_size])

    def batch(self, rows: Int64[np.ndarray, "b"]) -> Batch:
        """The scenes with these rows as torch tensors."""
        c = {name: column[rows] for name, column in self.columns.items()}
        return Batch(
            hands=hands_from(c["hand_position"], c["hand_quaternion"], c["hand_grasp_type"]),
            success=success_of(c["hand_outcome"]),
            weight=torch.from_numpy(c["hand_weight"]),
            selection_weight=torch.from_numpy(c["hand_selection_weight"]),
            images=torch.from_numpy(to_metres(c["image"])[:, None]),
            friction=torch.from_numpy(c["hand_lateral_friction"]),
            held=torch.from_numpy(c["hand_held"].astype(np.float32)),
            **_objects(c),
        )


@dataclass(frozen=True)
class AttemptLoader:
    """Batches of attempts: ``loader.batches(epoch)`` yields the same batches whenever it is asked for that epoch.

    Attributes:
        columns: See `GraspDataset.attempt_columns`.
        split, batch_size, seed, shuffle: See `GraspDataset.attempts`; a batch may be smaller than asked for.
    """

    columns: Columns
    split: Split
    batch_size: int
    seed: int = 0
    shuffle: bool = True

    def batches(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch."""
        rng = generator(self.seed, Stream.ATTEMPT_ORDER, epoch)
        total = len(self.columns["draw"])
        starts = np.arange(0, total, BLOCK)
        if self.shuffle:
            starts = rng.permutation(starts)
        for first in range(0, len(starts), WINDOW):
            blocks = [np.arange(s, min(s + BLOCK, total)) for s in starts[first : first + WINDOW]]
            rows = np.concatenate(blocks)
            rows = rows[in_split(self.columns["draw"][rows], self.split)]
            if self.shuffle:
                rows = rng.permutation(rows)
            for start in range(0, len(rows), self.batch_size):
                yield self.batch(rows[start : start + self.batch_size])

    def batch(self, rows: Int64[np.ndarray, "b"]) -> Batch:
        """The attempts with these rows as torch tensors."""
        return attempt_batch({name: column[rows] for name, column in self.columns.items()})


def attempt_batch(columns: Columns) -> Batch:
    """Attempts as scenes of one hand, (B, 1), without an image; both weights are p / q of hand and object."""
    position, quaternion, grasp_type = (columns[n][:, None] for n in ("position", "quaternion", "grasp_type"))
    weight = torch.from_numpy(np.exp(columns["log_weight"] + columns["object_log_weight"])[:, None])
    return Batch(
        hands=hands_from(position, quaternion, grasp_type),
        success=success_of(columns["outcome"][:, None]),
        weight=weight,
        selection_weight=weight,
        images=torch.zeros(len(weight), 1, 0, 0),
        friction=torch.from_numpy(columns["lateral_friction"][:, None]),
        held=torch.from_numpy(columns["held"].astype(np.float32)[:, None]),
        **_objects(columns),
    )


def _objects(columns: Columns) -> dict[str, torch.Tensor]:
    """What is known of the object of each scene."""
    known = {name: torch.from_numpy(columns[name]) for name in ("scale", "object_pose")}
    return known | {"object_index": torch.from_numpy(columns["object_index"].astype(np.int64))}
