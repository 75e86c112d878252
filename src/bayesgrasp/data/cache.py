"""Shards unpacked once into raw arrays, so that training reads any row through a memory map.

A map holds nothing in memory that is not being read: the operating system keeps what fits and drops what does not. The
arrays are `.npy` files; they are written in order, flushed, into a folder of another name that is renamed at the end,
so a cache is whole or absent. Its name says which shards it was made of.

A damaged array would be learned from in silence. So the index, sealed, holds every array's size, time of writing and
CRC-32. A file whose size and time are the written ones is believed, as version control does it; any other is read
through once, and the cache is made again where it differs.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
import zlib
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from bayesgrasp.data.manifest import Entry
from bayesgrasp.errors import DataError
from bayesgrasp.files import MIB, NO_ROOM, PART, flush_directory, make_directory, read_json, write_json
from bayesgrasp.plain_data import restored
from bayesgrasp.sealed import sealed, unsealed

Columns = dict[str, np.ndarray]
INDEX = "index.json"


@dataclass(frozen=True)
class Written:
    """A file of the cache as it was written.

    Attributes:
        size: Bytes.
        time: Of the last change, nanoseconds.
        crc: CRC-32 of the content.
    """

    size: int
    time: int
    crc: int


def unpacked(
    directory: Path, name: str, entries: Iterable[Entry], rows: int, read: Callable[[int], Columns]
) -> Columns:
    """Memory maps of the columns of a table, over all chunks in order; made if they are not there, or damaged.

    Args:
        directory: Where caches are kept.
        name: Of the table.
        entries: The chunks.
        rows: Rows of all chunks together.
        read: Columns of one chunk, by its number.

    Raises:
        DataError: A shard is damaged, or the disk is full.
    """
    chunks = sorted(entries, key=lambda entry: entry.chunk)
    digest = hashlib.sha256("".join("".join(e.sha256) for e in chunks).encode()).hexdigest()[:16]
    target = directory / f"{name}-{digest}"
    try:
        names = _intact(target)
        if not names:
            _build(target, [entry.chunk for entry in chunks], rows, read)
            names = _intact(target)
        return {column: np.load(target / f"{column}.npy", mmap_mode="r", allow_pickle=False) for column in names}
    except OSError as error:
        why = "the disk is full" if error.errno in NO_ROOM else error.strerror or error
        raise DataError(f"cannot unpack the data set into {target}: {why}") from error


def _intact(target: Path) -> list[str]:
    """The columns of a cache that is what was written; none where it is absent or damaged."""
    try:
        content = read_json(target / INDEX, MIB)
        if not isinstance(content, dict):
            return []
        content = unsealed(content)
        files = {name: restored(Written, value) for name, value in content.items()}
        return sorted(files) if all(_is_intact(target, name, was) for name, was in files.items()) else []
    except (OSError, ValueError):  # no index, an altered one, or a file of it that is not there
        return []


def _is_intact(target: Path, name: str, was: Written) -> bool:
    path, status = target / f"{name}.npy", (target / f"{name}.npy").stat()
    if status.st_size != was.size:
        return False
    # Clocks of files are coarse: one changed in the moment in which the index was written may bear the old time.
    settled = was.time < (target / INDEX).stat().st_mtime_ns
    return (settled and status.st_mtime_ns == was.time) or _crc(path) == was.crc


def _crc(path: Path) -> int:
    value = 0
    with path.open("rb") as file:
        while part := file.read(MIB):
            value = zlib.crc32(part, value)
    return value


def _build(target: Path, chunks: list[int], rows: int, read: Callable[[int], Columns]) -> None:
    part = target.with_name(f"{target.name}.{secrets.token_hex(4)}{PART}")
    try:
        make_directory(part)
        _unpack(part, chunks, rows, read)
        _write_index(part)
        shutil.rmtree(target, ignore_errors=True)
        part.rename(target)
        flush_directory(target.parent)
    except OSError:
        # Another process may have been quicker.
        if not _intact(target):
            raise
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _unpack(part: Path, chunks: list[int], rows: int, read: Callable[[int], Columns]) -> None:
    files: dict[str, BinaryIO] = {}
    written = 0
    with ExitStack() as stack:
        for chunk in chunks:
            columns = read(chunk)
            written += len(next(iter(columns.values())))
            for name, column in columns.items():
                if name not in files:
                    files[name] = stack.enter_context((part / f"{name}.npy").open("wb"))
                    _write_header(files[name], column, rows)
                files[name].write(np.ascontiguousarray(column).tobytes())
        for file in files.values():
            file.flush()
            os.fsync(file.fileno())
    if written != rows:
        raise DataError(f"the shards of {part.parent.parent} hold {written} rows, their journal says {rows}")


def _write_index(part: Path) -> None:
    paths = sorted(part.glob("*.npy"))
    files = {path.stem: Written(path.stat().st_size, path.stat().st_mtime_ns, _crc(path)) for path in paths}
    write_json(part / INDEX, sealed({name: asdict(file) for name, file in files.items()}))


def _write_header(file: BinaryIO, column: np.ndarray, rows: int) -> None:
    header = {
        "descr": np.lib.format.dtype_to_descr(column.dtype),
        "fortran_order": False,
        "shape": (rows, *column.shape[1:]),
    }
    np.lib.format.write_array_header_1_0(file, header)
