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

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bayesgrasp.data.manifest import TABLES, Entry, Manifest
from bayesgrasp.data.schema import SCHEMA_VERSION, AttemptRecords
from bayesgrasp.data.shards import LARGEST, Chunk, Shard, decode, read_attempts
from bayesgrasp.errors import DataError, FileError, InvalidConfigurationError, shown
from bayesgrasp.files import MIB, PART, append, make_directory, read_bytes, read_json, write_bytes, write_json

LARGEST_MANIFEST, LARGEST_JOURNAL = 64 * MIB, 1024 * MIB
"""Bytes; a line of the journal has about 500."""
GO_ON = "; every finished chunk is kept: make room and go on with --resume"


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
        with _data_errors():
            for table in TABLES:
                make_directory(directory / table)
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
        if not self.manifest_path.exists():
            raise DataError(f"{self.directory} holds no data set: it has no manifest.json")
        try:
            content = read_json(self.manifest_path, LARGEST_MANIFEST)
        except FileError as error:
            raise DataError(f"the manifest is damaged or cannot be read: {error}") from error
        version = content.get("schema_version") if isinstance(content, dict) else None
        if version != SCHEMA_VERSION:
            raise DataError(
                f"{self.directory} has schema version {shown(version)}; this version of bayesgrasp reads "
                f"{SCHEMA_VERSION}: make the data set again with `bayesgrasp generate`"
            )
        try:
            return Manifest.from_dict(content)
        except (ValueError, InvalidConfigurationError) as error:
            raise DataError(f"{self.manifest_path} is damaged: {error}") from error

    def write_manifest(self, manifest: Manifest) -> None:
        """Replace the manifest, atomically; raises `DataError` where the disk refuses."""
        with _data_errors(GO_ON):
            write_json(self.manifest_path, manifest.to_dict())

    def entries(self) -> dict[int, Entry]:
        """The chunks that count, by number, in order.

        Raises:
            DataError: The journal is damaged elsewhere than at its torn end.
        """
        if not self.journal_path.exists():
            return {}
        with _data_errors():
            lines = read_bytes(self.journal_path, LARGEST_JOURNAL).split(b"\n")[:-1]
        try:
            found = {entry.chunk: entry for entry in map(Entry.from_line, lines)}
        except ValueError as error:
            raise DataError(f"{self.journal_path} is damaged: {error}") from error
        return dict(sorted(found.items()))

    def add(self, chunk: int, shard: Shard, entry: Entry) -> None:
        """Make a chunk count: its files, then its line.

        Raises:
            DataError: The disk is full or refuses; what was there before is untouched.
        """
        with _data_errors(GO_ON):
            for table in TABLES:
                write_bytes(self.path(table, chunk), getattr(shard, table))
            append(self.journal_path, entry.to_line().encode())

    def prepare(self) -> None:
        """Clear what an interrupted run left half-done: files under their temporary names and a torn line."""
        with _data_errors():
            for folder in (self.directory, *(self.directory / table for table in TABLES)):
                make_directory(folder)
                for leftover in folder.glob(f"*{PART}"):
                    leftover.unlink(missing_ok=True)
            if self.journal_path.exists():
                whole, end, torn = read_bytes(self.journal_path, LARGEST_JOURNAL).rpartition(b"\n")
                if torn:
                    os.truncate(self.journal_path, len(whole + end))

    def verify(self, entry: Entry) -> None:
        """Compare the files of a chunk with their checksums.

        Raises:
            DataError: A file is missing or is not the one that was written.
        """
        for table, expected in zip(TABLES, entry.sha256, strict=True):
            path = self.path(table, entry.chunk)
            if not path.exists():
                raise DataError(f"{path} is missing; {self._remedy(entry.chunk)}")
            with _data_errors():
                found = hashlib.sha256(read_bytes(path, LARGEST)).hexdigest()
            if found != expected:
                raise DataError(
                    f"{path} is not the file that was written (truncated or altered); {self._remedy(entry.chunk)}"
                )

    def forget(self, chunks: set[int]) -> None:
        """Take chunks out of the journal, so that they are made again; atomically."""
        kept = [entry.to_line() for entry in self.entries().values() if entry.chunk not in chunks]
        with _data_errors():
            write_bytes(self.journal_path, "".join(kept).encode())

    def chunk(self, index: int) -> Chunk:
        """Read a chunk; raises `DataError` where it is damaged."""
        return decode(self.path("attempts", index), self.path("scenes", index), index)

    def attempts(self, index: int) -> AttemptRecords:
        """Read the attempts of a chunk; raises `DataError` where they are damaged."""
        return read_attempts(self.path("attempts", index), index)

    def _remedy(self, chunk: int) -> str:
        return f"run `generate --resume --repair` to make chunk {chunk} again, the same as before"


@contextmanager
def _data_errors(remedy: str = "") -> Iterator[None]:
    """Failures of the disk as failures of a data set."""
    try:
        yield
    except OSError as error:
        raise DataError(f"{error}{remedy}") from error
