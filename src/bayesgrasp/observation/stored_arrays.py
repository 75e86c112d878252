"""The array in a PNG, .npy or .npz file, with everything that the file claims checked before memory is taken for it.

A file of a few kilobytes can claim terabytes (the header of a NumPy array), expand to gigabytes (a PNG, a zip
archive), or hold one flipped bit. So the size comes first, from the header alone; then the checksums: every chunk of a
PNG has one, so has every member of an archive, and a NumPy array has as many bytes as its shape says. Decoders see
only what they need: a PNG's header and pixels, no text, no animation.
"""

from __future__ import annotations

import ast
import io
import math
import struct
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from PIL import Image

from bayesgrasp.errors import DepthImageError, clipped, shown
from bayesgrasp.geometry.camera import MOST_PIXELS

PNG_START = b"\x89PNG\r\n\x1a\n"
NUMPY_START = b"\x93NUMPY"
LONGEST_HEADER = 1024
"""Bytes of the header of a NumPy array; those of plain numbers have 118."""
MOST_MEMBERS = 1000
"""Arrays of an archive."""
BITS, GREY = 16, 0
"""Of a depth PNG: bits of a sample, and the colour type of one channel."""


@dataclass(frozen=True)
class _Header:
    """What a NumPy array says about itself, and where its numbers begin."""

    dtype: np.dtype
    fortran: bool
    shape: tuple[int, ...]
    start: int

    @property
    def size(self) -> int:
        """Bytes of header and numbers together."""
        return self.start + math.prod(self.shape) * self.dtype.itemsize


def png_array(content: bytes) -> Shaped[np.ndarray, "h w"]:
    """The pixels of a PNG file of one channel of 16 bits.

    Raises:
        DepthImageError: Another kind of file or of PNG, too many pixels, or damaged.
    """
    chunks = list(_chunks(content))
    if not chunks or chunks[0][0] != b"IHDR" or len(chunks[0][1]) != 13:
        raise DepthImageError("is a damaged PNG file: it does not begin with its size")
    width, height, bits, colour, _, _, interlaced = struct.unpack(">IIBBBBB", chunks[0][1])
    if (bits, colour) != (BITS, GREY):
        raise DepthImageError(f"a depth PNG has one channel of 16 bits, this one has {bits} bits and colour {colour}")
    _check_pixels((height, width))
    size = sum(rows * (1 + 2 * columns) for rows, columns in _passes(height, width, bool(interlaced)))
    pixels = _inflated(b"".join(data for name, data in chunks if name == b"IDAT"), size)
    # Compressed again in no time (level 0): Pillow undoes the filters, on bytes that are all there.
    parts = (chunks[0], (b"IDAT", zlib.compress(pixels, 0)), (b"IEND", b""))
    plain = PNG_START + b"".join(_chunk(name, data) for name, data in parts)
    try:
        with Image.open(io.BytesIO(plain), formats=("PNG",)) as image:
            return np.array(image)
    except (OSError, SyntaxError, ValueError) as error:  # Pillow's words for damage
        raise DepthImageError(f"is a damaged PNG file: {clipped(error)}") from error


def npy_array(content: bytes) -> Shaped[np.ndarray, "..."]:
    """The numbers of a .npy file.

    Raises:
        DepthImageError: Not such a file, not numbers, too many of them, or not as many as its header says.
    """
    header = _header(content)
    if len(content) != header.size:
        raise DepthImageError(
            f"is damaged: an array of shape {header.shape} and type {header.dtype} makes a file of {header.size} "
            f"bytes, this one has {len(content)}"
        )
    numbers = np.frombuffer(content, header.dtype, offset=header.start)
    return numbers.reshape(header.shape, order="F" if header.fortran else "C")


def npz_array(content: bytes, name: str) -> Shaped[np.ndarray, "..."]:
    """The array of a given name in a .npz file, or its only one.

    Raises:
        DepthImageError: Not such a file, no such array, or as for `npy_array`.
    """
    # The directory of an archive takes ten times the memory that it takes in the file.
    if content.count(b"PK\x01\x02") > MOST_MEMBERS:
        raise DepthImageError(f"is an archive of more than {MOST_MEMBERS} members")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return npy_array(_member(archive, name))
    except DepthImageError:
        raise
    except (OSError, ValueError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error, struct.error) as error:
        raise DepthImageError(f"is damaged, or not a .npz file of numbers: {clipped(error)}") from error


def _chunks(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Name and data of every chunk of a PNG file, up to its end."""
    if not content.startswith(PNG_START):
        raise DepthImageError("is not a PNG file")
    place, name = len(PNG_START), b""
    while name != b"IEND":
        if len(content) < place + 12:
            raise DepthImageError("is a damaged PNG file: it ends too early")
        length = int.from_bytes(content[place : place + 4], "big")
        name, data = content[place + 4 : place + 8], content[place + 8 : place + 8 + length]
        if content[place : place + 12 + length] != _chunk(name, data):
            raise DepthImageError(f"is a damaged PNG file: the checksum of its part {shown(name)} is wrong")
        yield name, data
        place += 12 + length


def _passes(height: int, width: int, interlaced: bool) -> Iterator[tuple[int, int]]:
    """Rows and columns of the images that a PNG is sent as: one, or the seven of Adam7, each finer than the last."""
    grids = ((0, 0, 8, 8), (0, 4, 8, 8), (4, 0, 8, 4), (0, 2, 4, 4), (2, 0, 4, 2), (0, 1, 2, 2), (1, 0, 2, 1))
    for row, column, down, right in grids if interlaced else ((0, 0, 1, 1),):
        rows, columns = len(range(row, height, down)), len(range(column, width, right))
        if columns:
            yield rows, columns


def _inflated(packed: bytes, size: int) -> bytes:
    """What was compressed by zlib, which must have exactly so many bytes."""
    inflater = zlib.decompressobj()
    try:
        content = inflater.decompress(packed, size + 1)
    except zlib.error as error:
        raise DepthImageError(f"is a damaged PNG file: {clipped(error)}") from error
    if len(content) != size or not inflater.eof:
        raise DepthImageError("is a damaged PNG file: it does not have as many pixels as its size says")
    return content


def _chunk(name: bytes, data: bytes) -> bytes:
    """A part of a PNG file: its length, its name, its data, and their checksum."""
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def _member(archive: zipfile.ZipFile, name: str) -> bytes:
    """The bytes of one .npy file in an archive, its checksum compared."""
    members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
    chosen = members.get(name) or (next(iter(members.values())) if len(members) == 1 else None)
    if chosen is None:
        names = clipped(", ".join(members) or "(none)", 80)
        raise DepthImageError(f"holds the arrays {names}; one array, or one named `{name}`, is valid")
    if chosen.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise DepthImageError("is compressed in another way than np.savez_compressed does")
    with archive.open(chosen) as member:
        begin = member.read(LONGEST_HEADER)
        size = _header(begin).size
        if chosen.file_size != size:
            raise DepthImageError(f"is damaged: its array has {chosen.file_size} bytes instead of {size}")
        return begin + member.read(size - len(begin) + 1)  # one more, so that the end is met and the checksum compared


def _header(content: bytes) -> _Header:
    if not content.startswith(NUMPY_START) or len(content) < 12:
        raise DepthImageError("is damaged, or not an array of NumPy")
    width = 2 if content[6] == 1 else 4
    start = 8 + width + int.from_bytes(content[8 : 8 + width], "little")
    if start > min(len(content), LONGEST_HEADER):
        raise DepthImageError("is damaged, or not an array of plain numbers: its header is too long")
    try:
        fields = ast.literal_eval(content[8 + width : start].decode("latin-1").strip())
        described, fortran, shape = (fields[name] for name in ("descr", "fortran_order", "shape"))
        dtype = np.dtype(described)
    except (ValueError, SyntaxError, TypeError, KeyError, MemoryError, RecursionError) as error:
        raise DepthImageError(f"is damaged: its header cannot be read: {clipped(error)}") from error
    if dtype.kind not in "uifb" or not isinstance(fortran, bool) or not _is_shape(shape):
        raise DepthImageError(f"depths must be integers or floating-point numbers, got {shown(fields)}")
    _check_pixels(shape)
    return _Header(dtype, fortran, shape, start)


def _is_shape(shape: object) -> bool:
    """Whole lengths; True is none, and neither is 20.0."""
    return isinstance(shape, tuple) and all(type(length) is int and length >= 0 for length in shape)


def _check_pixels(shape: tuple[int, ...]) -> None:
    if math.prod(shape) > MOST_PIXELS:
        raise DepthImageError(f"a depth image has at most {MOST_PIXELS:,} pixels, this one claims {shown(shape)}")
