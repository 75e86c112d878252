"""Depth images from files and to files, with the unit stated or safely told.

Depth files are 16-bit PNG (millimetres, as Kinect drivers and most data sets write them), or NumPy arrays in .npy or
.npz. A unit is told from the median of the returned depths: a camera that looks at a table sees it between 5 cm and
20 m, and no image is plausible in both metres (0.05 to 20) and millimetres (50 to 20,000).
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64, Shaped
from PIL import Image, UnidentifiedImageError

from bayesgrasp.errors import DepthImageError

Unit = Literal["auto", "m", "mm"]
SUFFIXES = (".png", ".npy", ".npz")
METRES = {"m": 1.0, "mm": 1e-3}
CLOSEST, FARTHEST = 0.05, 20.0
"""Plausible medians of the returned depths, metres."""
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
    path = Path(path)
    try:
        return checked_depth(_stored_array(path), unit, nan_is_hole)
    except DepthImageError as error:
        raise DepthImageError(f"{path}: {error}") from error


def checked_depth(
    stored: Shaped[np.ndarray, "..."], unit: Unit = "auto", nan_is_hole: bool = False
) -> Float32[np.ndarray, "h w"]:
    """Bring an array into the form of a depth image; arguments, result and errors as in `read_depth`."""
    if unit not in ("auto", "m", "mm"):
        raise DepthImageError(f"unknown unit {unit!r}; valid: auto, m, mm")
    if stored.dtype.kind not in "uif":
        raise DepthImageError(f"depths must be integers or floating-point numbers, got {stored.dtype}")
    if stored.dtype.itemsize == 1:
        raise DepthImageError("8-bit numbers cannot hold depths; this looks like a picture of a depth image")
    depth = _one_channel(stored).astype(np.float64)
    if nan_is_hole:
        depth = np.where(np.isfinite(depth), depth, 0.0)
    _check_values(depth)
    return (depth * METRES[_told_unit(depth, unit)]).astype(np.float32)


def write_depth_png(path: Path | str, depth: Float32[np.ndarray, "h w"]) -> None:
    """Write a depth image (metres) as a 16-bit PNG in millimetres.

    Raises:
        DepthImageError: A depth that 16 bits of millimetres cannot hold.
    """
    millimetres = np.rint(depth.astype(np.float64) * 1e3)
    if not ((millimetres >= 0) & (millimetres <= np.iinfo(np.uint16).max)).all():
        raise DepthImageError(f"depths must be from 0 to 65.535 m to be written to {path}, in millimetres of 16 bits")
    Image.fromarray(millimetres.astype(np.uint16)).save(path, format="PNG")


def _stored_array(path: Path) -> Shaped[np.ndarray, "..."]:
    if path.suffix.lower() not in SUFFIXES:
        raise DepthImageError(f"depth files end in {', '.join(SUFFIXES)}")
    try:
        return _png(path) if path.suffix.lower() == ".png" else _numpy(path)
    except DepthImageError:
        raise
    except OSError as error:
        raise DepthImageError(f"cannot be read: {error.strerror or error}") from error
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise DepthImageError(f"is damaged, or not a {path.suffix} file of numbers: {error}") from error


def _png(path: Path) -> Shaped[np.ndarray, "..."]:
    try:
        with Image.open(path) as image:
            if image.mode not in ("I;16", "I;16B"):
                raise DepthImageError(f"a depth PNG has one channel of 16 bits, this one has mode {image.mode}")
            return np.array(image)
    except UnidentifiedImageError as error:
        raise DepthImageError("is not a PNG file") from error
    except SyntaxError as error:  # what Pillow raises for a broken chunk
        raise DepthImageError(f"is a damaged PNG file: {error}") from error


def _numpy(path: Path) -> Shaped[np.ndarray, "..."]:
    content = np.load(path, allow_pickle=False)
    if isinstance(content, np.ndarray):
        return content
    with content:
        names = content.files
        name = "depth" if "depth" in names else names[0] if len(names) == 1 else None
        if name is None:
            raise DepthImageError(
                f"holds the arrays {', '.join(names) or '(none)'}; one array, or one named `depth`, is valid"
            )
        depth: Shaped[np.ndarray, "..."] = content[name]
        return depth


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
