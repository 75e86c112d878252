"""Attempts without images for r(S | h): every success in fresh poses each epoch, beside failures as they were made.

Successes are one in a hundred, and a classifier of h alone could learn them by heart. The planar refresh
(`planar_symmetry`) moves each of them to another pose p_O ~ p(p_O | rho, S = 1), which leaves p(h | S = 1) exactly as
it is, so an epoch shows hands that no other epoch showed. Failures are plenty; an epoch takes a fresh part of them.

The share of successes in a batch is chosen, and undone by the weights: with N attempts of an outcome class and n of
them in an epoch, each weighs N / n times its own p / q. Weighted, the attempts follow p(h) p(O) p(p_O) p(S | .).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Int64

from bayesgrasp.data.cache import Columns
from bayesgrasp.data.loader import GraspDataset, Split, attempt_batch, in_split
from bayesgrasp.data.schema import AttemptRecords, Batch
from bayesgrasp.errors import DataError, InvalidConfigurationError
from bayesgrasp.prior.planar_symmetry import PlanarRefresh
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Outcome

HELD_OUT_POSES = 4


@dataclass(frozen=True)
class AttemptsConfig:
    """What an epoch of attempts holds.

    Attributes:
        batch_size: Attempts in a batch.
        success_share: Share of them that are successes.
        poses: Fresh poses of every success in an epoch.

    Raises:
        InvalidConfigurationError: A value outside its range.
    """

    batch_size: int = 2048
    success_share: float = 0.25
    poses: int = 4

    def __post_init__(self) -> None:
        if self.batch_size < 2 or self.poses < 1 or not 0 < self.success_share < 1:
            raise InvalidConfigurationError(
                f"need batch_size >= 2, poses >= 1 and success_share between 0 and 1, got {self}"
            )

    @property
    def successes(self) -> int:
        """Successes in a batch."""
        return max(1, round(self.batch_size * self.success_share))


@dataclass(frozen=True)
class RefreshedAttempts:
    """Batches of attempts as scenes of one hand, (B, 1): the same whenever an epoch is asked for again.

    Attributes:
        columns: See `GraspDataset.attempt_columns`.
        split: Of the draws.
        refresh: The planar symmetry, with the arm's reach.
        config: See `AttemptsConfig`.
        seed: Of the order and of the poses.
        kept: Every epoch is the first one, made once and kept in memory: for the few attempts that are held out.
    """

    columns: Columns
    split: Split
    refresh: PlanarRefresh
    config: AttemptsConfig
    seed: int = 0
    kept: bool = False

    @cached_property
    def rows(self) -> tuple[Int64[np.ndarray, "successes"], Int64[np.ndarray, "others"]]:
        """Attempts of the split by outcome.

        Raises:
            DataError: The split has no success, or nothing else.
        """
        inside = in_split(self.columns["draw"], self.split)
        success = self.columns["outcome"] == Outcome.SUCCESS
        successes, others = np.flatnonzero(inside & success), np.flatnonzero(inside & ~success)
        if len(successes) == 0 or len(others) == 0:
            raise DataError(
                f"the {self.split} attempts are {len(successes)} successes and {len(others)} failures; some of both "
                "are needed: generate more"
            )
        return successes, others

    def __len__(self) -> int:
        """Batches of an epoch."""
        return -(-len(self.rows[0]) * self.config.poses // self.config.successes)

    def batches(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch."""
        return iter(self._first) if self.kept else self._made(epoch)

    @cached_property
    def _first(self) -> tuple[Batch, ...]:
        return tuple(self._made(0))

    def _made(self, epoch: int) -> Iterator[Batch]:
        rng = generator(self.seed, Stream.REFRESH, epoch)
        successes, others = self.rows
        few, many = self.config.successes, self.config.batch_size - self.config.successes
        chosen = _in_turns(successes, len(self) * few, rng), _in_turns(others, len(self) * many, rng)
        # Of each class as much weight as it has attempts, spread over the places that it got.
        factors = len(successes) / few, len(others) / many
        for step in range(len(self)):
            some, rest = (c[step * n : (step + 1) * n] for c, n in zip(chosen, (few, many), strict=True))
            factor = np.repeat(factors, (few, many)) / self.config.batch_size
            yield self._batch(some, rest, rng).reweighted(torch.from_numpy(factor.astype(np.float32))[:, None])

    def _batch(
        self, successes: Int64[np.ndarray, "s"], others: Int64[np.ndarray, "f"], rng: np.random.Generator
    ) -> Batch:
        there = self._records(successes)
        fresh, _ = self.refresh.redraw(there, np.ones(len(there), dtype=bool), rng)
        return attempt_batch(AttemptRecords.cat([AttemptRecords(**fresh.columns()), self._records(others)]).columns())

    def _records(self, rows: Int64[np.ndarray, "n"]) -> AttemptRecords:
        return AttemptRecords(**{name: np.ascontiguousarray(column[rows]) for name, column in self.columns.items()})


@dataclass(frozen=True)
class PractisedAttempts:
    """Batches of attempts of practice without an image, as scenes of one hand, (B, 1), each once in an epoch.

    Attributes:
        columns: See `GraspDataset.attempt_columns`.
        split: Of the draws.
        batch_size: Attempts in a batch; what is left over in an epoch is in the next.
        seed: Of the order.
    """

    columns: Columns
    split: Split
    batch_size: int = 512
    seed: int = 0

    @cached_property
    def rows(self) -> Int64[np.ndarray, "n"]:
        """Attempts of the split.

        Raises:
            DataError: There are none.
        """
        rows = np.flatnonzero(in_split(self.columns["draw"], self.split))
        if len(rows) == 0:
            raise DataError(f"practice has no {self.split} attempts: practise more")
        return rows

    def __len__(self) -> int:
        """Batches of an epoch."""
        return max(1, len(self.rows) // self.batch_size)

    def batches(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch; their selection weight is 1, since no attempt was chosen by its outcome."""
        order = generator(self.seed, Stream.ATTEMPT_ORDER, epoch).permutation(self.rows)
        for step in range(len(self)):
            rows = order[step * self.batch_size : (step + 1) * self.batch_size]
            batch = attempt_batch({name: column[rows] for name, column in self.columns.items()})
            yield replace(batch, selection_weight=torch.ones_like(batch.selection_weight))


def refreshed_attempts(
    dataset: GraspDataset, refresh: PlanarRefresh, config: AttemptsConfig | None = None, seed: int = 0
) -> tuple[RefreshedAttempts, RefreshedAttempts]:
    """Training and held-out attempts of a data set.

    Raises:
        DataError: A split has no success, or nothing else.
    """
    config = config or AttemptsConfig()
    # Held-out successes are few: more poses of each steady the loss that early stopping watches.
    steady = replace(config, poses=HELD_OUT_POSES * config.poses)
    training = RefreshedAttempts(dataset.attempt_columns, "train", refresh, config, seed)
    return training, RefreshedAttempts(dataset.attempt_columns, "validation", refresh, steady, seed, kept=True)


def _in_turns(rows: Int64[np.ndarray, "n"], count: int, rng: np.random.Generator) -> Int64[np.ndarray, "{count}"]:
    """So many rows, in random order, all of them once before any comes again."""
    rounds = [rng.permutation(rows) for _ in range(-(-count // len(rows)))]
    return np.concatenate(rounds)[:count]
