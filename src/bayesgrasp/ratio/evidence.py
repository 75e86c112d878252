"""Where points that are attached to the hand appear in the depth image, and what the image says there.

A fixed set of points in the hand frame (palm, finger links, closing region) is carried into the world by the hand
pose, projected with the canonical camera and looked up in the image by bilinear interpolation. The signed depth of a
point, its depth minus the measured depth at its pixel, says whether it is in free space (negative), on the visible
surface (zero) or behind it (positive): a projective signed distance, sampled in the hand's own frame. It is
differentiable in position and rotation.

The true camera differs from the canonical one by the nuisances of the sensor model; the network is trained on both.
"""

import itertools
from dataclasses import dataclass, field

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from jaxtyping import Float
from torch import Tensor, nn

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import IMAGE_SHAPE, Camera, canonical_camera
from bayesgrasp.types import Hands

Point = tuple[float, float, float]

LARGEST_SIDE = 2048
"""Of the network's image, pixels; every pixel's ray is kept in memory."""
NEAREST_DEPTH = 0.05
"""Points closer to the camera plane than this, metres, are projected as if they were here."""
FARTHEST_DEPTH = 1.5
"""Depth of the table plane where the camera looks above the horizon, metres."""


def closing_region() -> tuple[Point, ...]:
    """Default points: the volume of an open Robotiq 3-Finger from palm to fingertips, all grasp types.

    Approach 0 to 0.20 m, closing direction +-0.10 m (the open fingers), beside +-0.045 m (the two fingers of a pair).
    """
    along, across = (0.0, 0.04, 0.08, 0.12, 0.16, 0.20), (-0.10, -0.05, 0.0, 0.05, 0.10)
    return tuple(itertools.product(along, across, (-0.045, 0.0, 0.045)))


def between_fingertips() -> tuple[Point, ...]:
    """More points where the fingertips of a Robotiq 3-Finger close, 0.14 to 0.185 m ahead of the palm.

    A ball of 3 cm lies between the points of the closing region. Of three points beside each other the middle one comes
    first: it is the one where every third point's features are looked up (`local.LocalConfig`).
    """
    along, across, beside = (0.14, 0.165, 0.185), (-0.025, 0.0, 0.025), (0.0, -0.02, 0.02)
    return tuple(itertools.product(along, across, beside))


@dataclass(frozen=True)
class ViewConfig:
    """A pinhole camera as plain numbers, for the image that the network sees.

    Attributes:
        height, width: Size of the network's image, pixels.
        focal: (fx, fy), pixels.
        center: (cx, cy), pixels; integers are pixel centres.
        rotation: camera_to_world, row by row.
        translation: Camera position in the world frame, metres.
    """

    height: int
    width: int
    focal: tuple[float, float]
    center: tuple[float, float]
    rotation: tuple[Point, Point, Point]
    translation: Point

    def __post_init__(self) -> None:
        if min(self.height, self.width, *self.focal) <= 0:
            raise InvalidConfigurationError(f"a view needs positive sizes and focal lengths, got {self}")
        if max(self.height, self.width) > LARGEST_SIDE:
            raise InvalidConfigurationError(f"a view has at most {LARGEST_SIDE} pixels each way, got {self}")

    @staticmethod
    def of(camera: Camera, height: int = IMAGE_SHAPE[0], width: int = IMAGE_SHAPE[1]) -> "ViewConfig":
        """The view of a camera whose image is stretched to the network's size."""
        small = camera.resized(width, height)
        rows = [tuple(float(v) for v in row) for row in small.pose[:3]]
        rotation = (rows[0][:3], rows[1][:3], rows[2][:3])
        translation = (rows[0][3], rows[1][3], rows[2][3])
        return ViewConfig(height, width, (small.fx, small.fy), (small.cx, small.cy), rotation, translation)  # type: ignore[arg-type]


def canonical_view() -> ViewConfig:
    """The canonical camera at the network's image size."""
    return ViewConfig.of(canonical_camera())


class View(nn.Module):
    """Projection into, and geometry of, the image of a fixed camera."""

    rotation: Tensor
    translation: Tensor
    rays: Tensor
    table: Tensor

    def __init__(self, config: ViewConfig) -> None:
        super().__init__()
        self.config = config
        rotation, translation = np.array(config.rotation), np.array(config.translation)
        rays = _rays(config) @ rotation.T
        # Depth at which a ray of the camera meets z = 0; a ray that does not, is cut off.
        with np.errstate(divide="ignore"):
            table = np.where(rays[..., 2] < 0, -translation[2] / rays[..., 2], np.inf)
        constants = {"rotation": rotation, "translation": translation, "rays": rays.transpose(2, 0, 1)}
        constants["table"] = np.minimum(table, FARTHEST_DEPTH)
        for name, value in constants.items():
            self.register_buffer(name, torch.tensor(value, dtype=torch.float32), persistent=False)

    def fill(self, images: Float[Tensor, "b 1 height width"]) -> Float[Tensor, "b 1 height width"]:
        """Depth with the table's own depth where there was no return."""
        return torch.where(images > 0, images, self.table)

    def surface(self, depth: Float[Tensor, "b 1 height width"]) -> Float[Tensor, "b 3 height width"]:
        """World coordinates of the measured surface, metres."""
        return depth * self.rays + self.translation[:, None, None]

    def project(self, points: Float[Tensor, "*batch 3"]) -> tuple[Float[Tensor, "*batch 2"], Float[Tensor, "*batch"]]:
        """World points -> coordinates of `grid_sample` (both in [-1, 1] inside the image) and depth in metres."""
        x, y, depth = ((points - self.translation) @ self.rotation).unbind(-1)
        safe = depth.clamp_min(NEAREST_DEPTH)
        u = self.config.focal[0] * x / safe + self.config.center[0]
        v = self.config.focal[1] * y / safe + self.config.center[1]
        grid = torch.stack([(2 * u + 1) / self.config.width - 1, (2 * v + 1) / self.config.height - 1], -1)
        return grid, depth


@dataclass(frozen=True)
class PointsConfig:
    """Points attached to the hand.

    Attributes:
        view: The camera of the network's image.
        points: Coordinates in the hand frame, metres.
        scales: Signed depths are read through tanh(depth / scale), once for each of these scales, metres.
    """

    view: ViewConfig = field(default_factory=canonical_view)
    points: tuple[Point, ...] = field(default_factory=closing_region)
    scales: tuple[float, ...] = (0.01, 0.04)

    def __post_init__(self) -> None:
        if not self.points or not self.scales or min(self.scales) <= 0:
            raise InvalidConfigurationError("evidence needs at least one point and only positive scales")


class HandPoints(nn.Module):
    """Carries the points with the hand and looks them up in images."""

    points: Tensor

    def __init__(self, config: PointsConfig) -> None:
        super().__init__()
        self.view = View(config.view)
        self.register_buffer("points", torch.tensor(config.points), persistent=False)

    def forward(self, hands: Hands) -> tuple[Float[Tensor, "*batch p 2"], Float[Tensor, "*batch p"]]:
        """Sampling grid and depth (m) of every point of every hand."""
        # Rounded to bf16, a projection would be off by centimetres.
        with torch.autocast(hands.position.device.type, enabled=False):
            world = hands.position[..., None, :] + self.points.to(hands.position.dtype) @ hands.rotation.mT
            grid, depth = self.view.project(world)
        return grid, depth


def sample(maps: Float[Tensor, "b c height width"], grid: Float[Tensor, "b k p 2"]) -> Float[Tensor, "b c k p"]:
    """Bilinear look-up; outside the image, the nearest border pixel."""
    return F.grid_sample(maps.to(grid.dtype), grid, mode="bilinear", padding_mode="border", align_corners=False)


def _rays(config: ViewConfig) -> np.ndarray:
    """Points of the camera frame at depth 1, (height, width, 3)."""
    x = (np.arange(config.width) - config.center[0]) / config.focal[0]
    y = (np.arange(config.height) - config.center[1]) / config.focal[1]
    x, y = np.meshgrid(x, y)
    return np.stack([x, y, np.ones_like(x)], -1)
