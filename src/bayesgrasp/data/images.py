"""Depth images on disk: tenths of a millimetre, as places in a palette, differences along rows, byte planes, zstd.

A structured-light sensor returns few different depths (its disparity is in eighths of a pixel): some 200 in an image.
So an image is kept as its sorted depths and, for each pixel, the place of its depth among them. Neighbours differ by a
place or two; the differences, folded to 0, -1, 1, -2, 2, ... and with high and low bytes in planes of their own, are
what zstd does best. Lossless for any 16-bit image. `docs/data.md` has the sizes and times of the alternatives.
"""

from __future__ import annotations

import numpy as np
import zstandard
from jaxtyping import Float32, UInt16

from bayesgrasp.data.schema import DEPTH_UNIT
from bayesgrasp.errors import DataError
from bayesgrasp.geometry.camera import IMAGE_SHAPE

LEVEL = 3


def to_units(depth: Float32[np.ndarray, "*batch h w"]) -> UInt16[np.ndarray, "*batch h w"]:
    """Depth in metres as multiples of `DEPTH_UNIT`; 0 stays 0."""
    return np.rint(depth * np.float32(1 / DEPTH_UNIT)).astype(np.uint16)


def to_metres(image: UInt16[np.ndarray, "*batch h w"]) -> Float32[np.ndarray, "*batch h w"]:
    """Stored units as depth in metres."""
    return image.astype(np.float32) * np.float32(DEPTH_UNIT)


def pack(image: UInt16[np.ndarray, "h w"]) -> bytes:
    """Compress one image."""
    present = np.zeros(2**16, dtype=bool)
    present[image] = True
    palette = np.flatnonzero(present).astype("<u2")
    place = (np.cumsum(present) - 1)[image].astype(np.uint16)
    change = np.diff(place, axis=1, prepend=np.uint16(0)).view(np.int16)  # modulo 2^16, which the sum undoes
    folded = ((change << 1) ^ (change >> 15)).astype("<u2")
    planes = np.ascontiguousarray(folded).view(np.uint8).reshape(-1, 2).T
    content = np.uint32(len(palette)).astype("<u4").tobytes() + palette.tobytes() + planes.tobytes()
    return zstandard.ZstdCompressor(level=LEVEL).compress(content)


def unpack(packed: bytes) -> UInt16[np.ndarray, "h w"]:
    """Restore one image.

    Raises:
        DataError: The bytes are not an image of `IMAGE_SHAPE`.
    """
    pixels = IMAGE_SHAPE[0] * IMAGE_SHAPE[1]
    try:
        content = zstandard.ZstdDecompressor().decompress(packed, max_output_size=4 + 2 * 2**16 + 2 * pixels)
    except zstandard.ZstdError as error:
        raise DataError(f"a stored image cannot be decompressed: {error}") from error
    colours = int.from_bytes(content[:4], "little")
    if len(content) != 4 + 2 * colours + 2 * pixels:
        raise DataError(f"a stored image has {len(content)} bytes, which is not an image of {IMAGE_SHAPE}")
    palette = np.frombuffer(content, "<u2", colours, 4)
    planes = np.frombuffer(content, np.uint8, offset=4 + 2 * colours).reshape(2, -1).T
    folded = np.ascontiguousarray(planes).view("<u2").reshape(IMAGE_SHAPE)
    change = (folded >> 1) ^ (0 - (folded & 1)).astype(np.uint16)
    place = np.cumsum(change, axis=1, dtype=np.uint16)
    return palette[place].astype(np.uint16)
