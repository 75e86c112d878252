"""A data set on disk: shards that are whole or absent, a journal of those that count, and a manifest.

    DIR/manifest.json             what the data is: schema, seed, configuration, objects, gripper, commit, counts
    DIR/journal.jsonl             one line for each chunk that is done: rows, counts by outcome, SHA-256 of its files
    DIR/attempts/000000123.parquet
    DIR/scenes/000000123.parquet
    DIR/cache/                    made by the loader, may be deleted at any time

Exactly once. The content of a chunk depends on the seed and its number alone, so making it twice gives the same bytes.
Files are written under another name, flushed to the disk and renamed, the journal line comes last. A program killed
at any moment leaves either a line, and then its files, or no line, and then the chunk is made again over whatever is
there. A torn last line of the journal is no line.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from bayesgrasp.data.schema import SCHEMA_VERSION, AttemptRecords
from bayesgrasp.data.shards import Chunk, Shard, decode, read_attempts
from bayesgrasp.errors import DataError, InvalidConfigurationError

TABLES = ("attempts", "scenes")


Given = Literal["image", "object"]


@dataclass(frozen=True)
class Manifest:
    """What a data set is. `identity` decides whether more chunks may be added to it.

    Attributes:
        seed: The one seed of everything.
        config: The configuration, as JSON values.
        objects: Ordered: `id`, `sha256`, `split`, `mass_kg` of each.
        gripper: Name of the gripper.
        attempts: How many attempts were asked for.
        commit: Commit of the program, where known.
        version: Version of the program.
        totals: Counts when the run ended: attempts, scenes, outcomes by name, per object; empty before.
        schema_version: Of the shards.

    Raises:
        InvalidConfigurationError: No attempts, or a negative seed.
    """

    seed: int
    config: dict[str, Any]
    objects: list[dict[str, Any]]
    gripper: str
    attempts: int
    commit: str = ""
    version: str = ""
    totals: dict[str, Any] = field(default_factory=dict)
    schema_version: int = SCHEMA_VERSION

    def __post_init__(self) -> None:
        if self.attempts < 1:
            raise InvalidConfigurationError(f"the number of attempts must be at least 1, got {self.attempts}")
        if self.seed < 0:
            raise InvalidConfigurationError(f"the seed must be at least 0, got {self.seed}")

    @property
    def given(self) -> Given:
        """What the hands of a set of practice were proposed from (`generation.practice`)."""
        return "object" if self.config.get("practice") == {"given": "object"} else "image"

    @property
    def identity(self) -> dict[str, Any]:
        """Everything that the content of a chunk depends on."""
        return {
            "schema_version": self.schema_version,
            "seed": self.seed,
            "gripper": self.gripper,
            "objects": self.objects,
            "config": self.config,
        }


@dataclass(frozen=True)
class Entry:
    """One line of the journal.

    Attributes:
        chunk: Number of the chunk.
        attempts, scenes: Rows.
        outcomes: For each object that occurs, by its index as text: counts by `Outcome` value.
        sha256: Of the two files, in the order of `TABLES`.
    """

    chunk: int
    attempts: int
    scenes: int
    outcomes: dict[str, list[int]]
    sha256: list[str]


class Store:
    """A data set in a directory.

    Args:
        directory: Where it is; see the module for what is in it.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    @classmethod
    def create(cls, directory: Path, manifest: Manifest) -> Store:
        """Start an empty data set.

        Raises:
            DataError: The directory already holds a data set, or cannot be written.
        """
        store = cls(directory)
        if store.manifest_path.exists():
            raise DataError(f"{directory} already holds a data set; choose another directory or go on with --resume")
        with _disk_errors(directory):
            for table in TABLES:
                (directory / table).mkdir(parents=True, exist_ok=True)
        store.write_manifest(manifest)
        return store

    @property
    def manifest_path(self) -> Path:
        """Where the manifest is."""
        return self.directory / "manifest.json"

    @property
    def journal_path(self) -> Path:
        """Where the journal is."""
        return self.directory / "journal.jsonl"

    def path(self, table: str, chunk: int) -> Path:
        """Where a file of a chunk is."""
        return self.directory / table / f"{chunk:09d}.parquet"

    def manifest(self) -> Manifest:
        """Read the manifest.

        Raises:
            DataError: There is none, or it is damaged or of another schema.
        """
        try:
            content = json.loads(self.manifest_path.read_text())
            version = content["schema_version"]
            if version != SCHEMA_VERSION:
                raise DataError(
                    f"{self.directory} has schema version {version}; this version of bayesgrasp reads "
                    f"{SCHEMA_VERSION}: make the data set again with `bayesgrasp generate`"
                )
            return Manifest(**content)
        except FileNotFoundError as error:
            raise DataError(f"{self.directory} holds no data set: it has no manifest.json") from error
        except (ValueError, KeyError, TypeError) as error:
            raise DataError(f"{self.manifest_path} is damaged: {error}") from error

    def write_manifest(self, manifest: Manifest) -> None:
        """Replace the manifest, atomically."""
        self._replace(self.manifest_path, (json.dumps(asdict(manifest), indent=1) + "\n").encode())

    def entries(self) -> dict[int, Entry]:
        """The chunks that count, by number, in order.

        Raises:
            DataError: The journal is damaged elsewhere than at its torn end.
        """
        if not self.journal_path.exists():
            return {}
        lines = self.journal_path.read_bytes().split(b"\n")[:-1]
        try:
            found = [Entry(**json.loads(line)) for line in lines]
        except (ValueError, TypeError) as error:
            raise DataError(f"{self.journal_path} is damaged: {error}") from error
        return {entry.chunk: entry for entry in sorted(found, key=lambda e: e.chunk)}

    def add(self, chunk: int, shard: Shard, entry: Entry) -> None:
        """Make a chunk count: its files, then its line.

        Raises:
            DataError: The disk is full or refuses; what was there before is untouched.
        """
        for table in TABLES:
            self._replace(self.path(table, chunk), getattr(shard, table))
        with _disk_errors(self.journal_path), self.journal_path.open("ab") as journal:
            start = journal.tell()
            try:
                journal.write(json.dumps(asdict(entry)).encode() + b"\n")
                journal.flush()
                os.fsync(journal.fileno())
            except OSError:
                os.ftruncate(journal.fileno(), start)
                raise

    def prepare(self) -> None:
        """Clear what an interrupted run left half-done: files under their temporary names and a torn line."""
        with _disk_errors(self.directory):
            for table in TABLES:
                (self.directory / table).mkdir(exist_ok=True)
                for leftover in (self.directory / table).glob("*.part"):
                    leftover.unlink(missing_ok=True)
            if self.journal_path.exists():
                whole = self.journal_path.read_bytes().rpartition(b"\n")
                if whole[2]:
                    os.truncate(self.journal_path, len(whole[0]) + len(whole[1]))

    def verify(self, entry: Entry) -> None:
        """Compare the files of a chunk with their checksums.

        Raises:
            DataError: A file is missing or is not the one that was written.
        """
        for table, expected in zip(TABLES, entry.sha256, strict=True):
            path = self.path(table, entry.chunk)
            try:
                found = hashlib.sha256(path.read_bytes()).hexdigest()
            except FileNotFoundError as error:
                raise DataError(f"{path} is missing; {self._remedy(entry.chunk)}") from error
            if found != expected:
                raise DataError(
                    f"{path} is not the file that was written (truncated or altered); {self._remedy(entry.chunk)}"
                )

    def forget(self, chunks: set[int]) -> None:
        """Take chunks out of the journal, so that they are made again; atomically."""
        kept = [json.dumps(asdict(e)) + "\n" for e in self.entries().values() if e.chunk not in chunks]
        self._replace(self.journal_path, "".join(kept).encode())

    def chunk(self, index: int) -> Chunk:
        """Read a chunk; raises `DataError` where it is damaged."""
        return decode(self.path("attempts", index), self.path("scenes", index), index)

    def attempts(self, index: int) -> AttemptRecords:
        """Read the attempts of a chunk; raises `DataError` where they are damaged."""
        return read_attempts(self.path("attempts", index), index)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Keep a second writer out; the lock dies with the process.

        Raises:
            DataError: Another process is writing.
        """
        with _disk_errors(self.directory):
            handle = (self.directory / "lock").open("w")
        with handle:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise DataError(f"another process is writing to {self.directory}") from error
            yield

    def _remedy(self, chunk: int) -> str:
        return f"run `generate --resume --repair` to make chunk {chunk} again, the same as before"

    def _replace(self, path: Path, content: bytes) -> None:
        part = path.with_name(f"{path.name}.{os.getpid()}.part")
        with _disk_errors(path):
            try:
                with part.open("wb") as handle:
                    handle.write(content)
                    handle.flush()
                    os.fsync(handle.fileno())
                part.replace(path)
            finally:
                part.unlink(missing_ok=True)
            _flush_directory(path.parent)


def _flush_directory(directory: Path) -> None:
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def _disk_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise DataError(
                f"the disk is full at {path}; every finished chunk is kept: free space and --resume"
            ) from error
        raise DataError(f"cannot write {path}: {error.strerror or error}") from error
