"""Depth images of any camera, seen as the canonical camera would see them, or as a map from above.

The networks know one camera. An image of another one, with known intrinsics and pose, is a surface that hides the space
behind it; it is drawn again from where the canonical camera stands. A ray of the canonical camera that enters hidden
space (through the surface from behind, or through the curtain between an edge and its background) before it meets the
surface stays a hole, for there may be anything. Only the bare table outside the other camera's field of view may be
completed, since the table is the plane z = 0 by convention.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64

from bayesgrasp.errors import DepthImageError, InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.simulators.surface_kernels import draw_surface

MAX_SLOPE = float(np.tan(np.deg2rad(80.0)))
NOISE_ALLOWANCE = 0.005
"""Neighbouring pixels are one surface if their depths differ by no more than a slope of `MAX_SLOPE` explains, plus this
(metres): three deviations of the axial noise of a Kinect v1 at 1 m."""
BEHIND = 0.01
"""Hidden space hides what is further away by more than this, metres; noise turns parts of a steep surface around."""
LOWEST = -0.05
"""Points further below the table than this are not drawn, metres."""


@dataclass(frozen=True)
class MapConfig:
    """Extent of a top-down map: a square of the table around the world origin.

    Attributes:
        side: Length of the square, metres.
        cells: Number of cells along each side.

    Raises:
        InvalidConfigurationError: A value that is not positive.
    """

    side: float = 0.4
    cells: int = 128

    def __post_init__(self) -> None:
        if not (0 < self.side < np.inf and 1 <= self.cells <= 4096):
            raise InvalidConfigurationError(f"a map needs a positive side and 1 to 4096 cells, got {self}")


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
    pixels, seen_depth = target.project(_surface_points(bound, camera))
    front, back = np.zeros((target.height, target.width)), np.zeros((target.height, target.width))
    with np.errstate(divide="ignore"):
        _draw(bound, depth > 0, camera, pixels, 1 / seen_depth, front, back)
    hidden = (back > 0) & (front * BEHIND < 1 - front / np.where(back > 0, back, 1.0))
    image = np.divide(1.0, front, out=np.zeros_like(front), where=(front > 0) & ~hidden)
    return (_with_table(image, camera, target) if complete_table else image).astype(np.float32)


def height_map(
    depth: Float[np.ndarray, "h w"], camera: Camera, config: MapConfig | None = None
) -> Float32[np.ndarray, "2 n n"]:
    """A top-down map of the workspace.

    Args:
        depth: Image of `camera`, metres, 0 = no return.
        camera: Its intrinsics and pose in the world frame.
        config: Extent of the map.

    Returns:
        Height above the table (metres, 0 where not seen) and visibility (1 where seen). Entry [:, i, j] is at
        x = (i + 1/2) side / n - side / 2 and y = (j + 1/2) side / n - side / 2 of the world frame.

    Raises:
        DepthImageError: The image does not fit the camera, or the camera has no pose.
    """
    config = MapConfig() if config is None else config
    _check_image(depth, camera)
    points = _surface_points(depth, camera)
    cells = (points[..., :2] / config.side + 0.5) * config.cells - 0.5
    heights = np.full((config.cells, config.cells), LOWEST)
    _draw(depth, depth > 0, camera, cells[..., ::-1], points[..., 2], heights, np.empty_like(heights))
    seen = heights > LOWEST
    return np.stack([np.where(seen, heights, 0.0), seen]).astype(np.float32)


def _check_image(depth: Float[np.ndarray, "h w"], camera: Camera) -> None:
    if depth.shape != (camera.height, camera.width):
        raise DepthImageError(
            f"a depth image of shape {depth.shape} does not fit a camera of {camera.height} rows and "
            f"{camera.width} columns"
        )
    if not np.isfinite(depth).all() or depth.min(initial=0) < 0:
        raise DepthImageError("a depth image to re-project must hold finite depths >= 0, with 0 for no return")


def _surface_points(depth: Float[np.ndarray, "h w"], camera: Camera) -> Float64[np.ndarray, "h w 3"]:
    """World points of an image."""
    return camera.rays() * depth[..., None].astype(np.float64) @ camera.pose[:3, :3].T + camera.pose[:3, 3]


def _table_depth(camera: Camera) -> Float64[np.ndarray, "h w"]:
    """The image of the bare table, metres; 0 above the horizon."""
    down = -(camera.rays() @ camera.pose[2, :3])
    return np.divide(camera.pose[2, 3], down, out=np.zeros_like(down), where=down > 1e-6)


def _draw(
    depth: Float[np.ndarray, "h w"],
    returned: Bool[np.ndarray, "h w"],
    camera: Camera,
    places: Float64[np.ndarray, "h w 2"],
    key: Float64[np.ndarray, "h w"],
    front: Float64[np.ndarray, "H W"],
    back: Float64[np.ndarray, "H W"],
) -> None:
    slope = MAX_SLOPE / min(camera.fx, camera.fy)
    u, v = np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1])
    draw_surface(depth.astype(np.float64), returned, u, v, key, slope, NOISE_ALLOWANCE, front, back)


def _with_table(image: Float64[np.ndarray, "H W"], camera: Camera, target: Camera) -> Float64[np.ndarray, "H W"]:
    table = _table_depth(target)
    return np.where((image == 0) & ~_in_view(_surface_points(table, target), camera), table, image)


def _in_view(points: Float64[np.ndarray, "H W 3"], camera: Camera) -> Bool[np.ndarray, "H W"]:
    pixels, depth = camera.project(points)
    with np.errstate(invalid="ignore"):
        inside = (pixels > 1) & (pixels < np.array([camera.width, camera.height]) - 2)
    return inside.all(axis=-1) & (depth > 0)
