"""From pixels back to points, and parts of images: what tests need of a camera and the package does not."""

from dataclasses import replace

import numpy as np

from bayesgrasp.geometry.camera import Camera


def in_camera(camera: Camera, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Points (*batch, 3) in the camera frame, metres, of pixels (u, v) (*batch, 2) at a depth in metres."""
    x = (pixels[..., 0] - camera.cx) / camera.fx
    y = (pixels[..., 1] - camera.cy) / camera.fy
    return np.stack([x * depth, y * depth, depth], axis=-1)


def in_world(camera: Camera, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Points (*batch, 3) in the world frame, metres, of pixels (u, v) (*batch, 2) at a depth in metres."""
    world: np.ndarray = in_camera(camera, pixels, depth) @ camera.pose[:3, :3].T + camera.pose[:3, 3]
    return world


def seen_points(camera: Camera, image: np.ndarray) -> np.ndarray:
    """World points (n, 3), metres, of the pixels that returned."""
    rows, columns = np.nonzero(image)
    return in_world(camera, np.stack([columns, rows], axis=1).astype(float), image[rows, columns].astype(float))


def cropped(camera: Camera, column: int, row: int, width: int, height: int) -> Camera:
    """The camera of the part of the image that starts at (column, row) and has the given size."""
    return replace(camera, width=width, height=height, cx=camera.cx - column, cy=camera.cy - row)
