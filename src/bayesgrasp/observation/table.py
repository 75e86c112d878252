"""Where the table and the object are, for a camera whose pose nobody measured.

The table is the plane with most points (RANSAC, Fischler & Bolles 1981, then least squares); what rises above it near
the middle of the image is the object. The workspace is put there: origin on the table below the middle of the object, z
along the plane's normal towards the camera, x along the table towards the camera's side, as for the canonical camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64
from scipy import ndimage

from bayesgrasp.errors import DepthImageError, InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera

Points = Float64[np.ndarray, "n 3"]
Plane = tuple[Float64[np.ndarray, "3"], float]
"""(normal, offset): the plane's points satisfy normal . p = offset; unit normal, metres."""


FEWEST, SAMPLE = 100, 2000
"""Least number of points to find a plane in, and how many of them vote."""


@dataclass(frozen=True)
class TableConfig:
    """How to find the table.

    Attributes:
        stride: Every so many pixels, each way, are looked at.
        hypotheses: Planes through three random points that are tried.
        tolerance: Points closer to a plane than this belong to it, metres.
        min_share: Least share of the valid points that the table must have.
        thickness: Points higher than this above the table are not the table, metres.
        ceiling: Points higher than this are not on the table, metres.
        min_pixels: Fewer looked-at pixels in one piece are noise.
        largest_tilt: A plane tilted more than this against the stated table is another thing, radians.
        largest_shift: So is one whose distance from the camera differs by more than this, metres.
    """

    stride: int = 4
    hypotheses: int = 200
    tolerance: float = 0.006
    min_share: float = 0.2
    thickness: float = 0.012
    ceiling: float = 0.45
    min_pixels: int = 12
    largest_tilt: float = 0.2
    largest_shift: float = 0.1

    def __post_init__(self) -> None:
        if self.stride < 1 or self.hypotheses < 1 or self.min_pixels < 1:
            raise InvalidConfigurationError("stride, hypotheses and min_pixels must be positive")
        if not (0 < self.tolerance <= self.thickness < self.ceiling and 0 < self.min_share < 1):
            raise InvalidConfigurationError("need 0 < tolerance <= thickness < ceiling (m) and 0 < min_share < 1")


def locate_workspace(
    depth: Float[np.ndarray, "h w"], camera: Camera, rng: np.random.Generator, config: TableConfig | None = None
) -> Float64[np.ndarray, "4 4"]:
    """camera_to_world of a workspace centred at the object in the image.

    Args:
        depth: Depth image, metres, 0 or NaN = no return.
        camera: Its intrinsics; a pose is ignored.
        rng: For the random planes.
        config: How to find the table.

    Raises:
        DepthImageError: No plane holds enough of the image.
    """
    config = config or TableConfig()
    points = grid(depth, camera, config.stride)
    valid = np.isfinite(points).all(-1)
    normal, offset = fit_plane(points[valid], rng, config)
    height = points @ normal - offset
    with np.errstate(invalid="ignore"):
        above = valid & (height > config.thickness) & (height < config.ceiling)
    item = _central_piece(above, config.min_pixels)
    # Without any object the workspace is centred where the middle of the image meets the table.
    anchor = points[item] if item.any() else points[valid & (np.abs(height) < config.tolerance)]
    return _frame(normal, offset, anchor)


def fit_plane(points: Points, rng: np.random.Generator, config: TableConfig) -> Plane:
    """The plane that holds most points, its normal towards the camera (the origin).

    Raises:
        DepthImageError: Too few points, or no plane holds enough of them.
    """
    if len(points) < FEWEST:
        raise DepthImageError(f"only {len(points)} pixels have a depth: too few to find the table")
    normals, offsets = _hypotheses(points, rng, config)
    plane, share = _best(points, normals, offsets, rng, config)
    if share < config.min_share:
        raise DepthImageError(
            f"no table found: the best plane holds {100 * share:.0f} % of the image, at least "
            f"{100 * config.min_share:.0f} % is needed; give `camera_to_world` in the camera file"
        )
    return plane


def fit_plane_near(points: Points, expected: Plane, rng: np.random.Generator, config: TableConfig) -> Plane | None:
    """The plane that holds most points among those that could be the expected one, seen by a camera somewhat off.

    Args:
        points: Camera frame, metres.
        expected: Where the plane is said to be, its normal towards the camera.
        rng: For the random planes.
        config: What counts as near, and as a plane.

    Returns:
        None where no such plane holds enough of the points.
    """
    if len(points) < FEWEST:
        return None
    normals, offsets = _hypotheses(points, rng, config)
    normal, offset = expected
    # A turned camera sees the table tilted but at the same distance; only a shifted one sees it at another.
    near = (normals @ normal > np.cos(config.largest_tilt)) & (np.abs(offsets - offset) < config.largest_shift)
    plane, share = _best(points, normals[near], offsets[near], rng, config)
    return plane if share >= config.min_share else None


def _hypotheses(
    points: Points, rng: np.random.Generator, config: TableConfig
) -> tuple[Float64[np.ndarray, "m 3"], Float64[np.ndarray, "m"]]:
    """Planes through three random points each, normals towards the camera."""
    a, b, c = points[rng.integers(len(points), size=(3, config.hypotheses))]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    plane = lengths > 0  # none where a point was drawn twice: its normal of 0 would have every vote
    normals, a = normals[plane] / lengths[plane, None], a[plane]
    offsets = (a * normals).sum(1)
    towards = np.where(offsets < 0, 1.0, -1.0)
    return normals * towards[:, None], offsets * towards


def _best(
    points: Points,
    normals: Float64[np.ndarray, "m 3"],
    offsets: Float64[np.ndarray, "m"],
    rng: np.random.Generator,
    config: TableConfig,
) -> tuple[Plane, float]:
    """The plane that most of a sample of the points voted for, fitted to its points, and the share that it holds.

    The share is 0 where there is no plane to vote for.
    """
    if len(normals) == 0:
        return (np.array([0.0, 0.0, -1.0]), 0.0), 0.0
    sample = points[rng.integers(len(points), size=SAMPLE)]
    votes = (np.abs(sample @ normals.T - offsets) < config.tolerance).sum(0)
    normal, offset = normals[votes.argmax()], float(offsets[votes.argmax()])
    for _ in range(3):
        members = points[np.abs(points @ normal - offset) < config.tolerance]
        if len(members) < 3:
            break
        center = members.mean(0)
        # The direction in which they spread least.
        normal = np.linalg.eigh((members - center).T @ (members - center))[1][:, 0]
        offset = float(center @ normal)
    share = float((np.abs(points @ normal - offset) < config.tolerance).mean())
    return ((normal, offset) if offset < 0 else (-normal, -offset)), share


def grid(depth: Float[np.ndarray, "h w"], camera: Camera, stride: int) -> Float64[np.ndarray, "rows columns 3"]:
    """Points of every so many pixels, each way, in the camera frame, metres; NaN where there was no return."""
    first = stride // 2
    small = depth[first::stride, first::stride].astype(np.float64)
    u = (np.arange(first, camera.width, stride) - camera.cx) / camera.fx
    v = (np.arange(first, camera.height, stride) - camera.cy) / camera.fy
    rays = np.stack([*np.meshgrid(u, v), np.ones_like(small)], axis=-1)
    points: np.ndarray = np.where(small > 0, small, np.nan)[..., None] * rays
    return points


def _central_piece(above: np.ndarray, min_pixels: int) -> np.ndarray:
    """The piece that weighs most, a pixel counting less the farther it is from the middle of the image.

    What reaches over the border of the image (another robot, a wall) is taken only if there is nothing else.
    """
    labels, count = ndimage.label(above)
    if count == 0:
        return above
    row, column = (np.linspace(-1, 1, n) for n in above.shape)
    weight = np.exp(-2 * (row[:, None] ** 2 + column**2))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    totals = np.bincount(labels.ravel(), weights=weight.ravel(), minlength=count + 1)
    totals[(sizes < min_pixels) | (np.arange(count + 1) == 0)] = 0
    border = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    whole = totals.copy()
    whole[border] = 0
    best = whole if whole.any() else totals
    return labels == best.argmax() if best.any() else np.zeros_like(above)


def _frame(normal: np.ndarray, offset: float, anchor: Points) -> np.ndarray:
    # Image rows grow towards the camera's own side of the table; a level camera's forward axis says the same.
    towards = np.array([0.0, 1.0, -1.0])
    x = towards - (towards @ normal) * normal
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    low, high = np.percentile(anchor @ np.stack([x, y], 1), (2, 98), axis=0)
    origin = (low + high) / 2 @ np.stack([x, y]) + offset * normal
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, y, normal])
    pose[:3, 3] = -pose[:3, :3] @ origin
    return pose
