"""Depth images on disk: 16-bit numbers, differences along rows, the two bytes apart, zstd.

A row of depths changes slowly, so the differences of neighbours have few distinct high bytes; with high and low bytes
in planes of their own, zstd finds them. Lossless. `docs/data.md` has the sizes and times of the alternatives.
"""

from __future__ import annotations

import numpy as np
import zstandard
from jaxtyping import Float32, UInt16

from bayesgrasp.data.schema import DEPTH_UNIT, IMAGE_SHAPE
from bayesgrasp.errors import DataError

LEVEL = 3


def to_units(depth: Float32[np.ndarray, "*batch h w"]) -> UInt16[np.ndarray, "*batch h w"]:
    """Depth in metres as multiples of `DEPTH_UNIT`; 0 stays 0."""
    return np.rint(depth * np.float32(1 / DEPTH_UNIT)).astype(np.uint16)


def to_metres(image: UInt16[np.ndarray, "*batch h w"]) -> Float32[np.ndarray, "*batch h w"]:
    """Stored units as depth in metres."""
    return image.astype(np.float32) * np.float32(DEPTH_UNIT)


def pack(image: UInt16[np.ndarray, "h w"]) -> bytes:
    """Compress one image."""
    change = np.diff(image, axis=1, prepend=np.uint16(0))  # modulo 2^16, which the cumulative sum undoes
    planes = np.ascontiguousarray(change.astype("<u2")).view(np.uint8).reshape(-1, 2).T
    return zstandard.ZstdCompressor(level=LEVEL).compress(np.ascontiguousarray(planes).tobytes())


def unpack(packed: bytes) -> UInt16[np.ndarray, "h w"]:
    """Restore one image.

    Raises:
        DataError: The bytes are not an image of `IMAGE_SHAPE`.
    """
    size = IMAGE_SHAPE[0] * IMAGE_SHAPE[1]
    try:
        planes = zstandard.ZstdDecompressor().decompress(packed, max_output_size=2 * size)
    except zstandard.ZstdError as error:
        raise DataError(f"a stored image cannot be decompressed: {error}") from error
    if len(planes) != 2 * size:
        raise DataError(f"a stored image has {len(planes)} bytes instead of {2 * size} for {IMAGE_SHAPE}")
    change = np.frombuffer(planes, np.uint8).reshape(2, -1).T
    pixels = np.ascontiguousarray(change).view("<u2").reshape(IMAGE_SHAPE).astype(np.uint16)
    return np.cumsum(pixels, axis=1, dtype=np.uint16)
