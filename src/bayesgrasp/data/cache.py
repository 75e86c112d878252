"""Shards unpacked once into raw arrays, so that training reads any row through a memory map.

A map holds nothing in memory that is not being read: the operating system keeps what fits and drops what does not. The
arrays are `.npy` files; they are written in order, into a folder of another name that is renamed at the end, so a
cache is whole or absent. Its name says which shards it was made of.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

import numpy as np

from bayesgrasp.data.store import Entry
from bayesgrasp.errors import DataError

Columns = dict[str, np.ndarray]


def unpacked(
    directory: Path, name: str, entries: Iterable[Entry], rows: int, read: Callable[[int], Columns]
) -> Columns:
    """Memory maps of the columns of a table, over all chunks in order; made if they are not there.

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
    if not target.is_dir():
        _build(target, [entry.chunk for entry in chunks], rows, read)
    return {path.stem: np.load(path, mmap_mode="r") for path in sorted(target.glob("*.npy"))}


def _build(target: Path, chunks: list[int], rows: int, read: Callable[[int], Columns]) -> None:
    part = target.with_name(f"{target.name}.{os.getpid()}.part")
    try:
        part.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            files: dict[str, BinaryIO] = {}
            for chunk in chunks:
                for name, column in read(chunk).items():
                    if name not in files:
                        files[name] = stack.enter_context((part / f"{name}.npy").open("wb"))
                        _write_header(files[name], column, rows)
                    files[name].write(np.ascontiguousarray(column).tobytes())
        if not target.is_dir():
            part.rename(target)
    except OSError as error:
        raise DataError(f"cannot unpack the data set into {target}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _write_header(file: BinaryIO, column: np.ndarray, rows: int) -> None:
    header = {
        "descr": np.lib.format.dtype_to_descr(column.dtype),
        "fortran_order": False,
        "shape": (rows, *column.shape[1:]),
    }
    np.lib.format.write_array_header_1_0(file, header)
