"""Scenes on which the sensor model is measured: plates, a camera above a table, and pictures of what is seen."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from bayesgrasp.geometry.camera import Camera, look_at
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.objects.shapes import box
from bayesgrasp.types import Scenes

KINECT = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)
ABOVE = KINECT.with_pose(look_at(np.array([0.0, 0.0, 0.75]), np.zeros(3), up=np.array([0.0, 1.0, 0.0])))


def plate(width: float, depth: float, bottom: float, top: float) -> Mesh:
    """A box around the z axis, between two heights, metres."""
    return box(width, depth, top - bottom).moved(z=bottom).mesh


def scenes(n: int, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, index: int = 0) -> Scenes:
    """The same scene n times."""
    pose = np.tile(np.array([x, y, yaw], np.float32), (n, 1))
    return Scenes(np.full(n, index, np.int32), np.ones(n, np.float32), pose)


def show(axes: Axes, image: Float[np.ndarray, "h w"], title: str) -> None:
    """Draw a depth image; missing returns are black."""
    low, high = np.percentile(image[image > 0], [1, 99])
    axes.imshow(np.where(image > 0, image, np.nan), cmap="turbo", vmin=low, vmax=high, interpolation="nearest")
    axes.set(facecolor="black", title=title, xticks=[], yticks=[])
