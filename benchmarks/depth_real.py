"""Real depth images against the sensor model: the last part of `depth_sensor_figures.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from depth_scenes import plate, scenes, show
from jaxtyping import Bool, Float
from matplotlib.figure import Figure
from PIL import Image

from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.observation.canonical_view import to_canonical_view
from bayesgrasp.observation.depth_files import read_depth
from bayesgrasp.seeding import generator


def draw_real(directory: Path, target: Path) -> dict[str, object]:
    """Real images beside what the model makes of a block in their place, and the real images re-projected."""
    camera = Camera.load(directory / "camera.json")
    images = [read_depth(path) for path in sorted(directory.glob("depth_*.npy"))]
    masks = [np.array(Image.open(path)) > 0 for path in sorted(directory.glob("segmask_*.png"))]
    block = DepthSensor([plate(0.03, 0.1, 0.0, 0.025)], camera)
    model = block.render(scenes(1, 0.0, 0.0, 0.6), None, generator(6))[0]
    figure = Figure(figsize=(14, 5), layout="constrained")
    axes = figure.subplots(2, 5)
    for i, (image, mask) in enumerate(zip(images[:4], masks[:4], strict=True)):
        v, u = np.argwhere(mask).mean(0).astype(int)
        show(axes[0, i], image[v - 60 : v + 60, u - 60 : u + 60], f"real {i}")
    u, v = np.rint(camera.project(np.zeros(3))[0]).astype(int)
    show(axes[0, 4], model[v - 60 : v + 60, u - 60 : u + 60], "model, a block there")
    for i, image in enumerate(images):
        seen = to_canonical_view(image, camera)
        show(axes[1, i], seen[170:350, 200:440], f"real {i}, canonical camera")
    figure.savefig(target / "real.png", dpi=70)
    return {
        "table": {"real": [_table(i, camera) for i in images], "model": _table(model, camera)},
        "real_objects": [_placed(i, m, camera) for i, m in zip(images, masks, strict=True)],
    }


def _table(image: Float[np.ndarray, "h w"], camera: Camera) -> dict[str, float]:
    """Residuals of the bare table around the object, along the ray, after removing what varies over 40 px."""
    points = _points(image, camera)
    down = -(camera.rays() @ camera.pose[2, :3])
    bare = (abs(points[..., 2]) < 0.006) & (abs(points[..., :2]) < 0.15).all(axis=-1) & (image > 0)
    residual = np.where(bare, image - camera.pose[2, 3] / down, np.nan)
    blocks = [residual[r : r + 40, c : c + 40] for r in range(120, 330, 40) for c in range(160, 480, 40)]
    flat = [b - np.nanmean(b) for b in blocks if np.isfinite(b).all()]
    level = np.stack(flat)
    return {
        "blocks": len(flat),
        "spread_mm": 1e3 * float(level.std()),
        "offset_mm": 1e3 * float(np.nanmedian(np.where(bare, points[..., 2], np.nan))),
        "correlation_3px": float((level[:, :, 3:] * level[:, :, :-3]).mean() / level.var()),
        "correlation_8px": float((level[:, :, 8:] * level[:, :, :-8]).mean() / level.var()),
    }


def _points(image: Float[np.ndarray, "h w"], camera: Camera) -> Float[np.ndarray, "h w 3"]:
    """World points of all pixels, metres; the camera's own place where there is no return."""
    points: np.ndarray = camera.rays() * image[..., None] @ camera.pose[:3, :3].T + camera.pose[:3, 3]
    return points


def _placed(image: Float[np.ndarray, "h w"], mask: Bool[np.ndarray, "h w"], camera: Camera) -> dict[str, float]:
    """Height of a real object above the table (mm), measured in its own image and in the re-projected one."""
    own = _points(image, camera)[mask]
    seen = to_canonical_view(image, camera)
    world = _points(seen, canonical_camera())[seen > 0]
    near = world[(abs(world[:, :2]) < 0.12).all(axis=1)]
    return {
        "height_own_mm": 1e3 * float(np.percentile(own[:, 2], 99)),
        "height_canonical_mm": 1e3 * float(np.percentile(near[near[:, 2] > 0.008, 2], 99)),
        "table_canonical_mm": 1e3 * float(np.median(near[near[:, 2] < 0.004, 2])),
    }
