"""Scenes made of boxes, seen by an ideal depth camera: enough to plan on, without the sensor model."""

from dataclasses import dataclass

import numpy as np

from bayesgrasp.geometry.camera import Camera


@dataclass(frozen=True)
class Box:
    """A box on the table: middle (x, y), yaw, and size, metres and radians."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    size: tuple[float, float, float] = (0.05, 0.12, 0.12)


def _box_depth(origin: np.ndarray, rays: np.ndarray, box: Box) -> np.ndarray:
    """Depth along rays (of depth 1) to a box, inf where they miss it: slabs."""
    cos, sin = np.cos(box.yaw), np.sin(box.yaw)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    half = np.array(box.size) / 2
    start = turn @ (origin - [box.x, box.y, half[2]])
    with np.errstate(divide="ignore"):
        first, last = ((side * half - start) / (rays @ turn.T) for side in (-1, 1))
    enter, leave = np.minimum(first, last).max(-1), np.maximum(first, last).min(-1)
    return np.where((enter < leave) & (enter > 0), enter, np.inf)


def box_depth_image(camera: Camera, boxes: tuple[Box, ...] = ()) -> np.ndarray:
    """Noise-free depth (h, w) of boxes on a table, metres; 0 where a ray meets nothing."""
    rays = camera.rays() @ camera.pose[:3, :3].T
    origin = camera.pose[:3, 3]
    with np.errstate(divide="ignore"):
        depth = np.where(rays[..., 2] < 0, -origin[2] / rays[..., 2], np.inf)
    for box in boxes:
        depth = np.minimum(depth, _box_depth(origin, rays, box))
    return np.where(np.isfinite(depth), depth, 0.0).astype(np.float32)
