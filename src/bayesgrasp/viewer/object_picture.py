"""Pictures of objects: one as it is drawn above and as it collides below, or many, their convex parts in colours."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8

from bayesgrasp.geometry.camera import Camera, look_at
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.viewer.raycast import ColoredMesh, contact_sheet, render

VIEWS = ((35.0, 20.0), (125.0, 20.0), (35.0, 65.0))  # azimuth and elevation, degrees
SHEET_VIEW = (35.0, 35.0)
GOLDEN_RATIO = 0.618034
_CLAY = (0.80, 0.72, 0.60)
_TABLE = (0.55, 0.58, 0.62)


def object_picture(asset: ObjectAsset, size: int = 320) -> UInt8[np.ndarray, "h w 3"]:
    """Two rows of views: the mesh, then the convex parts, each on a piece of table; ``size`` is one view's edge."""
    table = _table(asset)
    mesh = [table, ColoredMesh(asset.vertices, asset.faces, _CLAY)]
    parts = [table, *_parts(asset)]
    cameras = [_camera(asset, azimuth, elevation, size) for azimuth, elevation in VIEWS]
    return contact_sheet([render(scene, camera) for scene in (mesh, parts) for camera in cameras], columns=len(VIEWS))


def objects_picture(assets: Sequence[ObjectAsset], columns: int, size: int = 150) -> UInt8[np.ndarray, "h w 3"]:
    """The convex parts of objects, row by row, each as large as its square of edge ``size`` allows."""
    scenes = [([_table(asset), *_parts(asset)], _camera(asset, *SHEET_VIEW, size)) for asset in assets]
    return contact_sheet([render(scene, camera) for scene, camera in scenes], columns)


def _parts(asset: ObjectAsset) -> list[ColoredMesh]:
    return [ColoredMesh(part.vertices, part.faces, _color(index)) for index, part in enumerate(asset.parts)]


def _camera(asset: ObjectAsset, azimuth: float, elevation: float, size: int) -> Camera:
    """A camera at a distance at which the object fills most of the picture."""
    low, high = asset.vertices.min(axis=0), asset.vertices.max(axis=0)
    angle, tilt = np.radians(azimuth), np.radians(elevation)
    direction = np.array([np.cos(angle) * np.cos(tilt), np.sin(angle) * np.cos(tilt), np.sin(tilt)])
    target = (low + high) / 2
    pose = look_at(target + 2.2 * float(np.linalg.norm(high - low)) * direction, target)
    centre = (size - 1) / 2
    return Camera(size, size, fx=1.9 * size, fy=1.9 * size, cx=centre, cy=centre, camera_to_world=pose)


def _table(asset: ObjectAsset) -> ColoredMesh:
    half = 0.6 * float(asset.extents.max())
    low, high = asset.vertices.min(axis=0) - 0.1 * half, asset.vertices.max(axis=0) + 0.1 * half
    corners = np.array([[low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0]])
    # Just below the plane, so that the two do not flicker through one another.
    return ColoredMesh(corners - (0, 0, 1e-3), np.array([[0, 1, 2], [0, 2, 3]]), _TABLE)


def _color(index: int) -> tuple[float, float, float]:
    return colorsys.hsv_to_rgb((index * GOLDEN_RATIO) % 1.0, 0.55, 0.9)
