"""What the user hands in, checked: a depth image, a camera, and the frame in which the posterior is evaluated.

The posterior is evaluated in a workspace frame: the world frame turned about z until the camera stands on the side
where it stood in training (left alone where it nearly does). Position box, rotation modes and object poses of the
priors are symmetric under quarter turns about z, and nearly so under others; the arm is not, which is why its path is
planned in the world frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Float64

from bayesgrasp.errors import DepthImageError
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.geometry.camera_file import INTRINSICS

Intrinsics = Camera | Mapping[str, float | int] | np.ndarray
SMALLEST_DEPTH, LARGEST_DEPTH = 0.15, 20.0
"""Metres; no depth camera measures a whole scene closer, nor anything farther: a median depth outside is a wrong unit,
and single pixels beyond are a driver's mark of no return."""
SCALES = 0.4, 2.5
"""The median of measured depths over the depths of the table; outside, the unit or the camera's pose is wrong."""
GRAZING = 0.2
"""Where a ray falls by less than this for each metre of depth, the table is so far that things stand before it."""
STEEPEST, NARROWEST = 11.0, 0.02
"""Largest tangent of a ray's angle with the optical axis (85 degrees), and least width of a view at 1 m, metres."""


def aligned_workspace(camera_to_world: Float64[np.ndarray, "4 4"], tolerance: float) -> Float64[np.ndarray, "4 4"]:
    """The world frame turned about z until the camera's side is +x; the identity where it is within the tolerance."""
    # Rows grow towards the camera's side of the table; for a level camera, its backward axis points there.
    side = camera_to_world[:3, :3] @ np.array([0.0, 1.0, -1.0])
    angle = math.atan2(side[1], side[0])
    pose = np.eye(4)
    if abs(angle) > tolerance:
        cos, sin = math.cos(angle), math.sin(angle)
        pose[:2, :2] = (cos, -sin), (sin, cos)
    return pose


def check_depth(depth: Any) -> Float32[np.ndarray, "h w"]:
    """A depth image as float32, with 0 wherever it claims more than `LARGEST_DEPTH`, or a clear error.

    Raises:
        DepthImageError: Not two-dimensional, not floating point, NaN or infinite, negative, empty, or not metres.
    """
    if not isinstance(depth, np.ndarray) or depth.ndim != 2:
        shape = getattr(depth, "shape", type(depth).__name__)
        raise DepthImageError(f"a depth image is a NumPy array of shape (height, width), got {shape}")
    if not np.issubdtype(depth.dtype, np.floating):
        raise DepthImageError(
            f"a depth image is floating point in metres, got {depth.dtype}: divide 16-bit millimetres by 1000"
        )
    if not np.isfinite(depth).all():
        raise DepthImageError("the depth image has NaN or infinite pixels: mark missing returns with 0")
    if (depth < 0).any():
        raise DepthImageError("the depth image has negative pixels: depths are metres, 0 = no return")
    if not (depth > 0).any():
        raise DepthImageError("the depth image is all zero: the camera returned nothing")
    if (median := float(np.median(depth[depth > 0]))) > LARGEST_DEPTH:
        raise DepthImageError(f"the median depth is {median:.0f}: depths are metres, these look like millimetres")
    if median < SMALLEST_DEPTH:
        raise DepthImageError(
            f"the median depth is {median:.3g} m, closer than a depth camera measures; depths are metres"
        )
    return np.where(depth > LARGEST_DEPTH, 0, depth).astype(np.float32)


def check_scale(depth: Float32[np.ndarray, "h w"], camera: Camera) -> None:
    """Compare measured depths with those of the table z = 0, where the camera with its pose looks at it.

    Raises:
        DepthImageError: They are of another order.
    """
    small = depth[::8, ::8]
    across, along, forward = camera.pose[2, :3]
    column, row = (np.arange(camera.width)[::8] - camera.cx) / camera.fx, (np.arange(camera.height)[::8] - camera.cy)
    down = -(across * column + along * row[:, None] / camera.fy + forward)
    seen = (small > 0) & (down > GRAZING)
    if not seen.any():
        return
    scale = float(np.median(small[seen] * down[seen])) / camera.pose[2, 3]
    if not SCALES[0] < scale < SCALES[1]:
        raise DepthImageError(
            f"the depths do not fit the camera's pose: they are typically {scale:.2g} times what the table's would be "
            f"for a camera {camera.pose[2, 3]:.2f} m above it; is the unit of the image, or of the pose, not metres?"
        )


def to_camera(
    intrinsics: Intrinsics, shape: tuple[int, ...], camera_to_world: Float[np.ndarray, "4 4"] | None = None
) -> Camera:
    """A camera from what the user has.

    Raises:
        DepthImageError: Numbers are missing or singular, the pose is not rigid, or the size is not that of the image.
    """
    if isinstance(intrinsics, Camera):
        camera = intrinsics
    elif isinstance(intrinsics, Mapping):
        camera = Camera.from_dict({"intrinsics": dict(intrinsics)})
    else:
        camera = _from_matrix(np.asarray(intrinsics), shape)
    if (camera.height, camera.width) != shape:
        raise DepthImageError(
            f"the depth image is {shape[1]} x {shape[0]} pixels, the intrinsics are for "
            f"{camera.width} x {camera.height}"
        )
    _check_view(camera)
    return camera if camera_to_world is None else camera.with_pose(np.asarray(camera_to_world, dtype=np.float64))


def _check_view(camera: Camera) -> None:
    """Refuse intrinsics that no pinhole camera has.

    Raises:
        DepthImageError: The image is wider than 85 degrees off the optical axis, or hardly wider than a point.
    """
    for axis, focal, center, size in (
        ("x", camera.fx, camera.cx, camera.width),
        ("y", camera.fy, camera.cy, camera.height),
    ):
        low, high = -center / focal, (size - 1 - center) / focal
        if max(abs(low), abs(high)) > STEEPEST or high - low < NARROWEST:
            raise DepthImageError(
                f"the intrinsics are those of no pinhole camera: with f{axis} = {focal:g} and c{axis} = {center:g} "
                f"an image of {size} pixels would reach from {low:.3g} to {high:.3g} m in {axis} at 1 m"
            )


def _from_matrix(matrix: np.ndarray, shape: tuple[int, ...]) -> Camera:
    if matrix.shape != (3, 3):
        raise DepthImageError(
            f"intrinsics are a Camera, the numbers {', '.join(INTRINSICS)} by name, or a 3 x 3 matrix; "
            f"got shape {matrix.shape}"
        )
    (fx, _, cx), (_, fy, cy), _ = matrix.astype(np.float64)
    return Camera(width=shape[1], height=shape[0], fx=float(fx), fy=float(fy), cx=float(cx), cy=float(cy))
