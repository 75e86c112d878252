"""What the networks see of a depth image (paper, section 3.1): 640x480 depths to {0} u [0.45, 1], resized to 256x160.

Each output pixel takes the value of the one input pixel that is nearest to its centre. Holes are never averaged into
valid depth, a returned depth stays one that the sensor can return, and the simulator needs to evaluate no other pixel.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32, Int64

from bayesgrasp.errors import DepthImageError
from bayesgrasp.geometry.camera import IMAGE_SHAPE

SENSOR_SHAPE = (480, 640)
NEAR, FAR = 0.45, 1.0
"""Depths outside are treated as no return, metres."""


def sampled_rows() -> Int64[np.ndarray, "160"]:
    """Rows of the 640x480 image that the resized image consists of."""
    return _nearest(SENSOR_SHAPE[0], IMAGE_SHAPE[0])


def sampled_columns() -> Int64[np.ndarray, "256"]:
    """Columns of the 640x480 image that the resized image consists of."""
    return _nearest(SENSOR_SHAPE[1], IMAGE_SHAPE[1])


def _nearest(size: int, resized: int) -> Int64[np.ndarray, "r"]:
    # Integers are the centres of pixels.
    centres: Int64[np.ndarray, "r"] = np.rint((np.arange(resized) + 0.5) * (size / resized) - 0.5).astype(np.int64)
    return centres


def preprocess(depth: Float[np.ndarray, "*batch h w"]) -> Float32[np.ndarray, "*batch 160 256"]:
    """Reduce depth images of the canonical camera to what the networks take.

    Args:
        depth: 640x480 images, metres, 0 or NaN = no return.

    Returns:
        256x160 images in {0} u [0.45, 1], metres, 0 = no return.

    Raises:
        DepthImageError: The images are not 640x480.
    """
    if depth.shape[-2:] != SENSOR_SHAPE:
        raise DepthImageError(
            f"a depth image of the canonical camera has shape {SENSOR_SHAPE}, got {depth.shape[-2:]}; "
            "bring images of another camera into its view with `to_canonical_view` first"
        )
    return in_range(depth[..., sampled_rows()[:, None], sampled_columns()].astype(np.float32))


def in_range(depth: Float32[np.ndarray, "*batch h w"]) -> Float32[np.ndarray, "*batch h w"]:
    """The images with every depth outside [`NEAR`, `FAR`] taken as no return, metres."""
    return np.where((depth >= np.float32(NEAR)) & (depth <= np.float32(FAR)), depth, np.float32(0.0))
