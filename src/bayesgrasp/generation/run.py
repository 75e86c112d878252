"""The run: which chunks are missing, in which rounds, done by whom, and written down exactly once.

The driver alone writes. Workers, near or far, get a chunk's number and send back the bytes of its two files, so a
cluster needs no shared disk, a worker may die at any moment, and the order in which results come back does not matter.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesgrasp.data.manifest import TABLES, Entry, Manifest
from bayesgrasp.data.schema import AttemptRecords
from bayesgrasp.data.shards import Chunk, Shard, encode
from bayesgrasp.data.store import Store
from bayesgrasp.errors import DataError
from bayesgrasp.generation.chunks import ChunkMaker, GenerateConfig, World
from bayesgrasp.generation.pool import Executor
from bayesgrasp.generation.proposal import Proposal, learn
from bayesgrasp.locks import sole_writer
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Outcome

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Task:
    """One chunk to make.

    Attributes:
        chunk: Its number.
        rows: How many of its attempts; all, except in the last chunk of a data set.
        proposal: Of the chunk's round.
    """

    chunk: int
    rows: int
    proposal: Proposal

    def __str__(self) -> str:
        return f"chunk {self.chunk}"


@dataclass(frozen=True)
class Done:
    """A chunk that was made: its files and its line of the journal."""

    shard: Shard
    entry: Entry


@dataclass(frozen=True)
class Recipe:
    """All that a worker needs to make chunks; picklable.

    Attributes:
        build: Makes the simulators, once in each worker.
        config: See `GenerateConfig`.
        seed: Of the data set.
        scene: p(O) p(p_O).
    """

    build: Callable[[], World]
    config: GenerateConfig
    seed: int
    scene: ScenePrior

    def start(self) -> Callable[[Task], Done]:
        """The function that a worker runs for every task."""
        maker = ChunkMaker(self.build(), self.config, self.seed, self.scene)
        return lambda task: finish(maker.make(task.chunk, task.rows, task.proposal), task.chunk)


@dataclass(frozen=True)
class Progress:
    """How far a run is; counts include what earlier runs made.

    Attributes:
        attempts, successes, scenes: So far.
        total: Attempts asked for.
        made: Attempts made by this run.
    """

    attempts: int
    successes: int
    scenes: int
    total: int
    made: int

    def after(self, entry: Entry) -> Progress:
        """The same, one chunk further."""
        successes = sum(counts[Outcome.SUCCESS] for counts in entry.outcomes.values())
        return Progress(
            self.attempts + entry.attempts,
            self.successes + successes,
            self.scenes + entry.scenes,
            self.total,
            self.made + entry.attempts,
        )


class Run:
    """Fills a store up to a number of attempts.

    Args:
        store: Where to; it has a manifest.
        recipe: What to make.
        attempts: How many there shall be.
        observe: Called after every chunk.
    """

    def __init__(
        self, store: Store, recipe: Recipe, attempts: int, observe: Callable[[Progress], None] | None = None
    ) -> None:
        self.store, self.recipe, self.attempts = store, recipe, attempts
        self.observe = observe or (lambda progress: None)
        self.entries: dict[int, Entry] = {}
        self.progress = Progress(0, 0, 0, attempts, 0)

    def execute(self, executor: Executor, repair: bool = False) -> Manifest:
        """Make every chunk that is missing and return the manifest with its final counts.

        Args:
            executor: Who does the work.
            repair: Make damaged chunks again instead of refusing to go on.

        Raises:
            FileError: Another process is writing.
            DataError: The disk is full, or a chunk is damaged and ``repair`` is False.
        """
        with sole_writer(self.store.directory):
            self.store.prepare()
            self.entries = self._intact(repair)
            counts = totals(self.entries)
            successes = counts["outcomes"][Outcome.SUCCESS.name.lower()]
            self.progress = Progress(counts["attempts"], successes, counts["scenes"], self.attempts, 0)
            self.observe(self.progress)
            if self._missing():
                with executor.start(self.recipe.start) as run:
                    for tasks in self._rounds():
                        for done in run(tasks):
                            self._keep(done)
            manifest = replace(self.store.manifest(), attempts=self.attempts, totals=totals(self.entries))
            self.store.write_manifest(manifest)
        return manifest

    def _intact(self, repair: bool) -> dict[int, Entry]:
        """The entries whose files are there and unaltered; those of a shorter last chunk are dropped."""
        entries = self.store.entries()
        damaged = set()
        for entry in entries.values():
            try:
                self.store.verify(entry)
            except DataError as error:
                if not repair:
                    raise
                logger.warning("%s", error)
                damaged.add(entry.chunk)
        rows = self._rows()
        dropped = damaged | {c for c, entry in entries.items() if entry.attempts < rows.get(c, 0)}
        if dropped:
            self.store.forget(dropped)
        return {c: entry for c, entry in entries.items() if c not in dropped}

    def _rows(self) -> dict[int, int]:
        size = self.recipe.config.attempts_per_chunk
        return {c: min(size, self.attempts - c * size) for c in range(-(-self.attempts // size))}

    def _missing(self) -> dict[int, int]:
        return {chunk: rows for chunk, rows in self._rows().items() if chunk not in self.entries}

    def _rounds(self) -> Iterator[list[Task]]:
        """Missing chunks, round by round; a round starts when all earlier ones are complete."""
        missing = self._missing()
        for number in sorted({self._round_of(chunk) for chunk in missing}):
            proposal = self._proposal(number)
            yield [Task(c, rows, proposal) for c, rows in missing.items() if self._round_of(c) == number]

    def _round_of(self, chunk: int) -> int:
        config = self.recipe.config
        return config.adaptive.round_of(chunk) if config.proposal == "adaptive" else 0

    def _proposal(self, number: int) -> Proposal:
        objects = self.recipe.scene.num_objects
        if number == 0:
            return replace(Proposal.prior(objects), objects=self.recipe.scene.probabilities)
        earlier = range(self.recipe.config.adaptive.round_start(number))
        records = AttemptRecords.cat([self.store.attempts(chunk) for chunk in earlier])
        rng = generator(self.recipe.seed, Stream.PROPOSAL, number)
        return learn(records, objects, self.recipe.config.adaptive, rng)

    def _keep(self, done: Done) -> None:
        self.store.add(done.entry.chunk, done.shard, done.entry)
        self.entries[done.entry.chunk] = done.entry
        self.progress = self.progress.after(done.entry)
        self.observe(self.progress)


def open_store(directory: Path, manifest: Manifest, resume: bool) -> Store:
    """The store for a run: new, or, with ``resume``, the one that is there.

    Raises:
        DataError: There is one and ``resume`` is False, or it was made with another seed, configuration or objects.
    """
    store = Store(directory)
    if not resume or not store.manifest_path.exists():
        return Store.create(directory, manifest)
    there = store.manifest()
    if different := differences(there.identity, manifest.identity):
        raise DataError(
            f"{directory} was made otherwise: {'; '.join(different[:5])}. Give the same options, or another directory"
        )
    if there.commit != manifest.commit:
        logger.warning("%s was started at commit %s and goes on at %s", directory, there.commit, manifest.commit)
    return store


def differences(there: Any, here: Any, path: str = "") -> list[str]:
    """Where two JSON values differ, in words."""
    if isinstance(there, dict) and isinstance(here, dict):
        keys = sorted(there.keys() | here.keys())
        return [d for k in keys for d in differences(there.get(k), here.get(k), f"{path}.{k}" if path else k)]
    if isinstance(there, list) and isinstance(here, list) and len(there) == len(here):
        pairs = enumerate(zip(there, here, strict=True))
        return [d for i, (a, b) in pairs for d in differences(a, b, f"{path}[{i}]")]
    return [] if there == here else [f"{path} is {_short(there)} there and {_short(here)} now"]


def totals(entries: dict[int, Entry]) -> dict[str, Any]:
    """Counts over all chunks: attempts, scenes, outcomes by name, and outcomes of each object by index."""
    objects: dict[str, np.ndarray] = {}
    for entry in entries.values():
        for index, counts in entry.outcomes.items():
            objects[index] = objects.get(index, np.zeros(len(Outcome), np.int64)) + np.array(counts)
    overall = sum(objects.values(), np.zeros(len(Outcome), np.int64))
    return {
        "attempts": sum(entry.attempts for entry in entries.values()),
        "scenes": sum(entry.scenes for entry in entries.values()),
        "outcomes": {outcome.name.lower(): int(overall[outcome]) for outcome in Outcome},
        "per_object": {index: objects[index].tolist() for index in sorted(objects, key=int)},
    }


def finish(chunk: Chunk, number: int) -> Done:
    """Encode a chunk and count its outcomes."""
    shard = encode(chunk, number)
    attempts = chunk.attempts
    outcomes = {
        str(index): np.bincount(attempts.outcome[attempts.object_index == index], minlength=len(Outcome)).tolist()
        for index in np.unique(attempts.object_index)
    }
    digests = [hashlib.sha256(getattr(shard, table)).hexdigest() for table in TABLES]
    return Done(shard, Entry(number, len(attempts), len(chunk.scenes), outcomes, digests))


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
