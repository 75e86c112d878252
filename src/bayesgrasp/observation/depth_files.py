"""Depth images from files and to files, with the unit stated or safely told.

Depth files are 16-bit PNG (millimetres, as Kinect drivers and most data sets write them), or NumPy arrays in .npy or
.npz. A unit is told from the median of the returned depths: a camera that looks at a table sees it between 5 cm and
20 m, and no image is plausible in both metres (0.05 to 20) and millimetres (50 to 20,000).
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64, Shaped
from PIL import Image

from bayesgrasp.errors import DepthImageError, FileError, shown
from bayesgrasp.files import MIB, read_bytes, write_through
from bayesgrasp.observation.stored_arrays import npy_array, npz_array, png_array

Unit = Literal["auto", "m", "mm"]
SUFFIXES = (".png", ".npy", ".npz")
NAME = "depth"
"""The array that is read from a .npz file of several."""
LARGEST = 512 * MIB
"""Bytes of a depth file: the largest image in numbers of 64 bits, and room to spare."""
METRES = {"m": 1.0, "mm": 1e-3}
CLOSEST, FARTHEST = 0.05, 20.0
"""Plausible medians of the returned depths, metres."""
BEYOND = 1e3
"""No depth camera measures this far, metres: such a pixel is somebody's mark for a missing return."""
SMALLEST_SIDE = 16
"""Anything smaller is not an image of a scene, pixels."""


def read_depth(path: Path | str, unit: Unit = "auto", nan_is_hole: bool = False) -> Float32[np.ndarray, "h w"]:
    """Read a depth image.

    Args:
        path: A 16-bit PNG file, or a .npy or .npz file with one array (or one named `depth`) of shape (h, w), (h, w, 1)
            or (1, h, w), of integers or floating-point numbers.
        unit: Unit of the stored numbers.
        nan_is_hole: Take NaN and infinity as no return, as ROS writes it, instead of refusing them.

    Returns:
        Depths in metres, 0 = no return.

    Raises:
        DepthImageError: The file cannot be read, has the wrong shape or type, holds NaN, infinite or negative numbers
            or no depth at all, or its depths are not plausible in the stated unit or in any unit.
    """
    stored = _stored_array(Path(path))
    try:
        return checked_depth(stored, unit, nan_is_hole)
    except DepthImageError as error:
        raise DepthImageError(f"{path}: {error}") from error


def depth_of(content: bytes, kind: str) -> Float32[np.ndarray, "h w"]:
    """The depth image in the bytes of a depth file.

    Args:
        content: Of the file.
        kind: One of `SUFFIXES`.

    Raises:
        DepthImageError: As `read_depth` does.
    """
    try:
        stored = _array_in(content, kind)
    except DepthImageError as error:
        raise DepthImageError(f"the depth file {error}") from error
    return checked_depth(stored)


def checked_depth(
    stored: Shaped[np.ndarray, "..."], unit: Unit = "auto", nan_is_hole: bool = False
) -> Float32[np.ndarray, "h w"]:
    """Bring an array into the form of a depth image; arguments, result and errors as in `read_depth`."""
    if unit not in ("auto", "m", "mm"):
        raise DepthImageError(f"unknown unit {unit!r}; valid: auto, m, mm")
    if stored.dtype.kind not in "uif":
        raise DepthImageError(f"depths must be integers or floating-point numbers, got {shown(stored.dtype)}")
    if stored.dtype.itemsize == 1:
        raise DepthImageError("8-bit numbers cannot hold depths; this looks like a picture of a depth image")
    with np.errstate(invalid="ignore"):  # of a signalling NaN, which is refused like any other
        depth = _one_channel(stored).astype(np.float64)
    if nan_is_hole:
        depth = np.where(np.isfinite(depth), depth, 0.0)
    _check_values(depth)
    metres = depth * METRES[_told_unit(depth, unit)]
    if (marked := int((metres > BEYOND).sum())) > 0:
        raise DepthImageError(
            f"{marked} of {depth.size} pixels are further than {BEYOND:g} m; a pixel without return is 0"
        )
    return metres.astype(np.float32)


def write_depth_png(path: Path | str, depth: Float32[np.ndarray, "h w"]) -> None:
    """Write a depth image (metres) as a 16-bit PNG in millimetres.

    Raises:
        DepthImageError: A depth that 16 bits of millimetres cannot hold.
    """
    millimetres = np.rint(depth.astype(np.float64) * 1e3)
    if not ((millimetres >= 0) & (millimetres <= np.iinfo(np.uint16).max)).all():
        raise DepthImageError(f"depths must be from 0 to 65.535 m to be written to {path}, in millimetres of 16 bits")
    write_through(path, lambda file: Image.fromarray(millimetres.astype(np.uint16)).save(file, format="PNG"))


def _stored_array(path: Path) -> Shaped[np.ndarray, "..."]:
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise DepthImageError(f"{path}: depth files end in {', '.join(SUFFIXES)}")
    try:
        content = read_bytes(path, LARGEST)
    except FileError as error:
        raise DepthImageError(f"depth image: {error}") from error
    try:
        return _array_in(content, kind)
    except DepthImageError as error:
        raise DepthImageError(f"{path} {error}") from error


def _array_in(content: bytes, kind: str) -> Shaped[np.ndarray, "..."]:
    if kind == ".png":
        return png_array(content)
    return npy_array(content) if kind == ".npy" else npz_array(content, NAME)


def _one_channel(stored: Shaped[np.ndarray, "..."]) -> Shaped[np.ndarray, "h w"]:
    image = stored
    if image.ndim == 3 and 1 in (image.shape[0], image.shape[2]):
        image = image[..., 0] if image.shape[2] == 1 else image[0]
    if image.ndim != 2:
        raise DepthImageError(f"a depth image has shape (h, w), (h, w, 1) or (1, h, w), got {stored.shape}")
    if min(image.shape) < SMALLEST_SIDE:
        raise DepthImageError(f"a depth image has at least {SMALLEST_SIDE} rows and columns, got {stored.shape}")
    return image


def _check_values(depth: Float64[np.ndarray, "h w"]) -> None:
    unusable = int((~np.isfinite(depth)).sum())
    if unusable:
        raise DepthImageError(
            f"{unusable} of {depth.size} pixels are NaN or infinite; a pixel without return is 0 "
            "(nan_is_hole=True takes them as that)"
        )
    if depth.min() < 0:
        raise DepthImageError(f"depths cannot be negative; the smallest is {depth.min():.4g}")
    if depth.max() == 0:
        raise DepthImageError("all pixels are 0: the camera returned no depth")


def _told_unit(depth: Float64[np.ndarray, "h w"], unit: Unit) -> Literal["m", "mm"]:
    median = float(np.median(depth[depth > 0]))
    plausible: list[Literal["m", "mm"]] = [name for name in ("m", "mm") if CLOSEST <= median * METRES[name] <= FARTHEST]
    if unit != "auto" and unit not in plausible:
        raise DepthImageError(
            f"the median depth is {median:.4g} {unit}, which is not between {CLOSEST} m and {FARTHEST} m; "
            f"is the unit wrong? ({' or '.join(plausible) or 'neither m nor mm'} would be plausible)"
        )
    if len(plausible) != 1:
        raise DepthImageError(
            f"the unit cannot be told from a median of {median:.4g}: it is implausible in m and in mm; "
            f"depths between {CLOSEST} m and {FARTHEST} m are valid"
        )
    return plausible[0]
