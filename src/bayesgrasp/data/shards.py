"""Records as Parquet, and back: flat tables that any Parquet reader opens.

A float column is stored with its bytes split into planes (BYTE_STREAM_SPLIT) and zstd, which loses nothing; an array
per row (a position, K hands) is a list column; an image is one compressed cell (`data.images`). The file's metadata
says which schema and which chunk it is, and every page carries a checksum.
"""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TypeVar, get_type_hints

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from bayesgrasp.data import images
from bayesgrasp.data.schema import SCHEMA_VERSION, AttemptRecords, HandRecords, SceneRecords
from bayesgrasp.errors import DataError, FileError, clipped
from bayesgrasp.files import MIB, read_bytes
from bayesgrasp.geometry.camera import IMAGE_SHAPE
from bayesgrasp.types import Columns

Records = TypeVar("Records", bound=Columns)
ROW_SHAPES = {
    "position": (3,),
    "quaternion": (4,),
    "object_pose": (3,),
    "camera_position_offset": (3,),
    "camera_rotation_vector": (3,),
}
HAND = "hand_"
LARGEST = 2048 * MIB
"""Bytes of a shard; those of the usual chunks have a few megabytes."""
REPAIR = "run `generate --resume --repair` to make it again"


@dataclass(frozen=True)
class Chunk:
    """The records of one unit of work.

    Attributes:
        attempts: All attempts, ordered by draw.
        scenes: Scenes of the same draws, ordered by draw.
        hands: The hands of each scene.
    """

    attempts: AttemptRecords
    scenes: SceneRecords
    hands: HandRecords


@dataclass(frozen=True)
class Shard:
    """A chunk as the bytes of its two files."""

    attempts: bytes
    scenes: bytes


def encode(chunk: Chunk, index: int) -> Shard:
    """The two Parquet files of a chunk; the same records give the same bytes."""
    scene_table = _table(chunk.scenes)
    for name, column in _table(chunk.hands, HAND).items():
        scene_table[name] = column
    return Shard(_write(_table(chunk.attempts), index), _write(scene_table, index))


def decode(attempts: Path, scenes: Path, index: int) -> Chunk:
    """Read a whole chunk back.

    Raises:
        DataError: A file is missing, damaged, of another schema, or of another chunk.
    """
    table = read_table(scenes, index)
    return Chunk(read_attempts(attempts, index), scenes_of(table), hands_of(table))


def read_attempts(path: Path, index: int, sha256: str | None = None) -> AttemptRecords:
    """The attempts of a chunk; arguments and errors as for `read_table`."""
    return _records(AttemptRecords, read_table(path, index, sha256))


def scenes_of(table: pa.Table) -> SceneRecords:
    """The scenes of a table read from a scenes file."""
    return _records(SceneRecords, table)


def hands_of(table: pa.Table) -> HandRecords:
    """The hands of a table read from a scenes file, of shape (scenes, K)."""
    return _records(HandRecords, table, HAND)


def read_table(path: Path, index: int, sha256: str | None = None) -> pa.Table:
    """One file of a chunk as an Arrow table.

    Args:
        path: The file.
        index: Number of the chunk that it must hold.
        sha256: What its content must have, where that is known.

    Raises:
        DataError: The file is missing, damaged, of another schema, or of another chunk.
    """
    content = _content(path, sha256)
    try:
        table = pq.read_table(pa.BufferReader(content), page_checksum_verification=True, use_threads=False)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise DataError(f"{path} is damaged ({clipped(error)}); {REPAIR}") from error
    _check(path, table.schema.metadata or {}, index)
    return table


def _content(path: Path, sha256: str | None) -> bytes:
    if not path.exists():
        raise DataError(f"{path} is missing; {REPAIR}")
    try:
        content = read_bytes(path, LARGEST)
    except FileError as error:
        raise DataError(f"{error}; {REPAIR}") from error
    if sha256 is not None and hashlib.sha256(content).hexdigest() != sha256:
        raise DataError(f"{path} is damaged: it is not the file that was written; {REPAIR}")
    return content


def _check(path: Path, metadata: dict[bytes, bytes], index: int) -> None:
    version, chunk = metadata.get(b"bayesgrasp.schema"), metadata.get(b"bayesgrasp.chunk", b"?")
    if version != str(SCHEMA_VERSION).encode():
        found = "no schema of bayesgrasp" if version is None else f"schema version {_word(version)}"
        raise DataError(f"{path} has {found}; this version reads schema version {SCHEMA_VERSION}")
    if chunk != str(index).encode():
        raise DataError(f"{path} holds chunk {_word(chunk)} where chunk {index} belongs")


def _word(text: bytes) -> str:
    return clipped(text.decode(errors="replace"), 20)


def _table(records: Columns, prefix: str = "") -> dict[str, pa.Array]:
    return {prefix + name: _to_arrow(name, column) for name, column in records.columns().items()}


def _to_arrow(name: str, column: np.ndarray) -> pa.Array:
    if name == "image":
        return pa.array([images.pack(image) for image in column], type=pa.binary())
    flat = pa.array(np.ascontiguousarray(column).reshape(-1))
    if column.ndim == 1:
        return flat
    size = int(np.prod(column.shape[1:]))
    return pa.ListArray.from_arrays(pa.array(np.arange(len(column) + 1, dtype=np.int32) * size), flat)


def _write(columns: dict[str, pa.Array], index: int) -> bytes:
    table = pa.table(columns).replace_schema_metadata(
        {"bayesgrasp.schema": str(SCHEMA_VERSION), "bayesgrasp.chunk": str(index)}
    )
    paths = {name: _leaf(name, table.schema.field(name).type) for name in columns}
    floats = [path for name, path in paths.items() if pa.types.is_floating(_value_type(table.schema.field(name).type))]
    sink = io.BytesIO()
    pq.write_table(
        table,
        sink,
        compression={path: "none" if name == "image" else "zstd" for name, path in paths.items()},
        use_dictionary=[path for name, path in paths.items() if path not in floats and name != "image"],
        use_byte_stream_split=floats,
        write_page_checksum=True,
        write_statistics=False,
    )
    return sink.getvalue()


def _value_type(kind: pa.DataType) -> pa.DataType:
    return kind.value_type if pa.types.is_list(kind) else kind


def _leaf(name: str, kind: pa.DataType) -> str:
    return f"{name}.list.element" if pa.types.is_list(kind) else name


def _records(kind: type[Records], table: pa.Table, prefix: str = "") -> Records:
    hints = {f.name: get_type_hints(kind)[f.name] for f in fields(kind)}  # type: ignore[arg-type]
    missing = [prefix + name for name in hints if prefix + name not in table.column_names]
    if missing:
        raise DataError(f"a shard lacks the columns {missing}; it was made with another version of bayesgrasp")
    columns = {name: _to_numpy(name, table.column(prefix + name), bool(prefix)) for name in hints}
    for name, column in columns.items():
        if str(column.dtype) not in hints[name].dtypes:
            raise DataError(f"the column {prefix + name} of a shard holds {column.dtype}, not {hints[name].dtypes[0]}")
    return kind(**columns)


def _to_numpy(name: str, column: pa.ChunkedArray, many: bool) -> np.ndarray:
    """A column as an array of its own shape: (rows, *row shape), or (rows, K, *row shape) for K values a row."""
    array = column.combine_chunks()
    rows = len(array)
    if name == "image":
        unpacked = [images.unpack(cell.as_py() or b"") for cell in array]
        return np.stack(unpacked) if rows else np.zeros((0, *IMAGE_SHAPE), np.uint16)
    values: np.ndarray = (array.flatten() if pa.types.is_list(array.type) else array).to_numpy(zero_copy_only=False)
    shape = ROW_SHAPES.get(name, ())
    per_row = len(values) // rows // int(np.prod(shape)) if rows else 0
    try:
        return values.reshape(rows, per_row, *shape) if many else values.reshape(rows, *shape)
    except ValueError as error:
        raise DataError(f"the column {name} of a shard has rows of different lengths; {REPAIR}") from error
