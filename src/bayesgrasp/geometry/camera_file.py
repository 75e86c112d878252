"""The camera file: JSON with `intrinsics` and, where it is known, `camera_to_world`; other keys are ignored.

    {"intrinsics": {"width": 640, "height": 480, "fx": 580.0, "fy": 580.0, "cx": 319.5, "cy": 239.5},
     "camera_to_world": {"translation_m": [0.4, 0.0, 0.7], "rotation": [[...], [...], [...]]}}

A number is a JSON number: no text, no true or false, nothing infinite. What the numbers mean, and which make a camera,
is for `camera.py`.
"""

from __future__ import annotations

from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import DepthImageError, FileError, shown
from bayesgrasp.files import MIB, read_json

INTRINSICS = ("width", "height", "fx", "fy", "cx", "cy")
LARGEST = MIB
"""Bytes of a camera file."""


def read_camera_file(path: str | Path) -> Any:
    """The content of a camera file, still to be checked.

    Raises:
        DepthImageError: The file is missing, too large, or not JSON.
    """
    try:
        return read_json(path, LARGEST)
    except FileError as error:
        raise DepthImageError(f"camera file: {error}") from error


def intrinsics_of(content: Any) -> dict[str, float]:
    """The numbers `INTRINSICS` of a camera file; the first two are whole.

    Raises:
        DepthImageError: One is missing, or is no number.
    """
    section = _section(content, "intrinsics", INTRINSICS)
    numbers = {key: float(_numbers(section[key], f"intrinsics.{key}", ())) for key in INTRINSICS}
    for key in ("width", "height"):
        if not numbers[key].is_integer():
            raise DepthImageError(f"intrinsics.{key} must be a whole number of pixels, got {numbers[key]:g}")
    return numbers


def pose_of(content: Any) -> Float64[np.ndarray, "4 4"] | None:
    """`camera_to_world` of a camera file; None where it does not state it.

    Raises:
        DepthImageError: It is there, and is not a translation and a rotation.
    """
    if content.get("camera_to_world") is None:
        return None
    section = _section(content, "camera_to_world", ("translation_m", "rotation"))
    pose = np.eye(4)
    pose[:3, :3] = _numbers(section["rotation"], "camera_to_world.rotation", (3, 3))
    pose[:3, 3] = _numbers(section["translation_m"], "camera_to_world.translation_m", (3,))
    return pose


def _section(content: Any, name: str, keys: tuple[str, ...]) -> dict[str, Any]:
    section = content.get(name) if isinstance(content, dict) else None
    missing = list(keys) if not isinstance(section, dict) else [key for key in keys if key not in section]
    if not isinstance(section, dict) or missing:
        raise DepthImageError(f"`{name}` must be an object with {', '.join(keys)}; missing: {', '.join(missing)}")
    return section


def _numbers(value: Any, name: str, shape: tuple[int, ...]) -> np.ndarray:
    what = f"an array of shape {list(shape)}" if shape else "a number"
    if not _has_shape(value, shape):
        raise DepthImageError(f"{name} must be {what}, got {shown(value)}")
    try:
        array = np.array(value, dtype=np.float64)
    except OverflowError as error:
        raise DepthImageError(f"{name} must be {what}, finite, got {shown(value)}") from error
    if not np.isfinite(array).all():
        raise DepthImageError(f"{name} must be {what}, finite, got {shown(value)}")
    return array


def _has_shape(value: Any, shape: tuple[int, ...]) -> bool:
    """Whether a value is numbers in lists of these lengths. NumPy would also take "1" and true for 1."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not shape:
        return isinstance(value, Real) and not isinstance(value, bool)
    if not isinstance(value, list | tuple) or len(value) != shape[0]:
        return False
    return all(_has_shape(inner, shape[1:]) for inner in value)
