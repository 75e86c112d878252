"""Depth images of any camera, seen as the canonical camera would see them.

The networks know one camera. An image of another one, with known intrinsics and pose, is a surface that hides the space
behind it; it is drawn again from where the canonical camera stands. A ray of the canonical camera that enters hidden
space (through the surface from behind, or through the curtain between an edge and its background) before it meets the
surface stays a hole, for there may be anything. Only the bare table outside the other camera's field of view may be
completed, since the table is the plane z = 0 by convention.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64

from bayesgrasp.errors import DepthImageError
from bayesgrasp.geometry.camera import Camera, canonical_camera, network_camera
from bayesgrasp.observation.preprocess import in_range, preprocess
from bayesgrasp.observation.surface_kernels import draw_surface

Coordinates = tuple[Float64[np.ndarray, "h w"], Float64[np.ndarray, "h w"], Float64[np.ndarray, "h w"]]

MAX_SLOPE = float(np.tan(np.deg2rad(80.0)))
NOISE_ALLOWANCE = 0.005
"""Neighbouring pixels are one surface if their depths differ by no more than a slope of `MAX_SLOPE` explains, plus this
(metres): three deviations of the axial noise of a Kinect v1 at 1 m."""
ROUNDED_UP = 0.25
"""Pixels are thinned to no less than 7/8 of the resolution that the network's image has at the workspace."""
BEHIND = 0.01
"""Hidden space hides what is further away by more than this, metres; noise turns parts of a steep surface around."""


class CanonicalView:
    """Brings depth images of any camera to the network's image."""

    def __init__(self) -> None:
        self._known, self._target = canonical_camera(), network_camera()
        self.shape = (self._target.height, self._target.width)

    def of(self, depth: Float32[np.ndarray, "h w"], camera: Camera) -> Float32[np.ndarray, "height width"]:
        """The network's image, metres, 0 = no return.

        Args:
            depth: Image of `camera`, metres, 0 = no return.
            camera: Its intrinsics and pose in the world frame. Images of the canonical camera are preprocessed as in
                training; others are drawn again.

        Raises:
            DepthImageError: The image does not fit the camera, or the camera has no pose.
        """
        if camera.matches(self._known):
            return preprocess(depth)
        step = self.step(camera)
        _check_image(depth, camera)
        return self.of_thinned(depth[step // 2 :: step, step // 2 :: step], camera, step)

    def step(self, camera: Camera) -> int:
        """Every so many pixels of a camera, each way, are drawn: it may see the workspace finer than the network."""
        middle = np.array([0.0, 0.0, 0.05])
        finer = [one.fx / np.linalg.norm(one.pose[:3, 3] - middle) for one in (camera, self._target)]
        return max(1, int(finer[0] / finer[1] + ROUNDED_UP))

    def of_thinned(
        self, depth: Float32[np.ndarray, "rows columns"], camera: Camera, step: int
    ) -> Float32[np.ndarray, "height width"]:
        """The network's image from every `step`-th pixel of an image of `camera`, from the `step // 2`-th on."""
        small = _thinned(camera, depth.shape, step)
        return in_range(to_canonical_view(depth, small, self._target, complete_table=True))


def to_canonical_view(
    depth: Float[np.ndarray, "h w"], camera: Camera, target: Camera | None = None, complete_table: bool = False
) -> Float32[np.ndarray, "H W"]:
    """Re-project a depth image into the canonical camera.

    Args:
        depth: Image of `camera`, metres, 0 = no return.
        camera: Its intrinsics and pose in the world frame.
        target: The camera to see it with; the canonical one unless given.
        complete_table: Show the table z = 0 where `target` looks at a place that is not in the image of `camera`.

    Returns:
        The image of `target`, metres, 0 = not seen.

    Raises:
        DepthImageError: The image does not fit the camera, or a camera has no pose.
    """
    target = canonical_camera() if target is None else target
    _check_image(depth, camera)
    bound = np.where(depth > 0, depth, _table_depth(camera))  # nothing is hidden beyond the table
    front, back = np.zeros((target.height, target.width)), np.zeros((target.height, target.width))
    _draw(bound, depth > 0, camera, _seen_by(target, bound, camera), front, back)
    hidden = (back > 0) & (front * BEHIND < 1 - front / np.where(back > 0, back, 1.0))
    image = np.divide(1.0, front, out=np.zeros_like(front), where=(front > 0) & ~hidden)
    return (_with_table(image, camera, target) if complete_table else image).astype(np.float32)


def _thinned(camera: Camera, shape: tuple[int, ...], step: int) -> Camera:
    """The camera that sees just every `step`-th pixel, each way; there are `shape` of them."""
    first = step // 2
    changes = {name: getattr(camera, name) / step for name in ("fx", "fy")}
    changes |= {name: (getattr(camera, name) - first) / step for name in ("cx", "cy")}
    return replace(camera, width=shape[1], height=shape[0], **changes)


def _check_image(depth: Float[np.ndarray, "h w"], camera: Camera) -> None:
    if depth.shape != (camera.height, camera.width):
        raise DepthImageError(
            f"a depth image of shape {depth.shape} does not fit a camera of {camera.height} rows and "
            f"{camera.width} columns"
        )
    if not np.isfinite(depth).all() or depth.min(initial=0) < 0:
        raise DepthImageError("a depth image to re-project must hold finite depths >= 0, with 0 for no return")


def _transformed(depth: Float[np.ndarray, "h w"], camera: Camera, pose: Float64[np.ndarray, "4 4"]) -> Coordinates:
    """x, y and z of the points of an image, in the frame that `pose` leads to from the camera's.

    A ray is linear in its pixel (u, v), so each coordinate is depth (a u + b v + c) + d: no point is ever formed.
    """
    to_rays = np.linalg.inv(camera.matrix)
    a, b, c = (pose[:3, :3] @ to_rays).T
    row, column = np.arange(camera.height, dtype=np.float64)[:, None], np.arange(camera.width, dtype=np.float64)
    x, y, z = (depth * ((a[k] * column + c[k]) + b[k] * row) + pose[k, 3] for k in range(3))
    return x, y, z


def _seen_by(target: Camera, depth: Float[np.ndarray, "h w"], camera: Camera) -> Coordinates:
    """Columns and rows (NaN behind it) of the points of an image in another camera, and their inverse depths, 1/m."""
    x, y, z = _transformed(depth, camera, np.linalg.inv(target.pose) @ camera.pose)
    with np.errstate(divide="ignore"):
        inverse = np.where(z > 0, 1 / z, np.nan)
    return target.fx * x * inverse + target.cx, target.fy * y * inverse + target.cy, inverse


def _table_depth(camera: Camera) -> Float64[np.ndarray, "h w"]:
    """The image of the bare table, metres; 0 above the horizon."""
    (_, _, height), flat = camera.pose[:3, 3], np.ones((camera.height, camera.width))
    down = height - _transformed(flat, camera, camera.pose)[2]
    scale: Float64[np.ndarray, "h w"] = np.divide(height, down, out=np.zeros_like(down), where=down > 1e-6)
    return scale


def _draw(
    depth: Float[np.ndarray, "h w"],
    returned: Bool[np.ndarray, "h w"],
    camera: Camera,
    places: Coordinates,
    front: Float64[np.ndarray, "H W"],
    back: Float64[np.ndarray, "H W"],
) -> None:
    """Draw an image's surface at the given columns, rows and keys."""
    allowance = MAX_SLOPE / min(camera.fx, camera.fy), NOISE_ALLOWANCE
    draw_surface(depth.astype(np.float64), returned, places, allowance, front, back)


def _with_table(image: Float64[np.ndarray, "H W"], camera: Camera, target: Camera) -> Float64[np.ndarray, "H W"]:
    table = _table_depth(target)
    return np.where((image == 0) & ~_in_view(table, target, camera), table, image)


def _in_view(depth: Float64[np.ndarray, "H W"], target: Camera, camera: Camera) -> Bool[np.ndarray, "H W"]:
    """Which points of an image of `target` are inside the image of `camera`."""
    u, v, _ = _seen_by(camera, depth, target)
    return (u > 1) & (u < camera.width - 2) & (v > 1) & (v < camera.height - 2)
