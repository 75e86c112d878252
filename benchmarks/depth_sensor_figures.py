"""Measure the sensor model against the published laws, and draw the figures of docs/depth_sensor.md.

python benchmarks/depth_sensor_figures.py [--real-depth DIR] [--docs docs/depth_sensor] [--json FILE]

`--real-depth` is a directory with depth_<i>.npy, segmask_<i>.png and camera.json of a real structured-light camera;
without it, the comparison with real images is left out.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from bayesgrasp.depth.kinect import axial_sigma, lateral_sigma, shadow_width
from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.depth.stereo import StereoConfig, hole_width, stereo_sigma
from bayesgrasp.geometry.camera import Camera, canonical_camera, look_at
from bayesgrasp.objects import household
from bayesgrasp.observation.canonical_view import to_canonical_view
from bayesgrasp.observation.depth_files import read_depth
from bayesgrasp.observation.preprocess import preprocess
from bayesgrasp.seeding import generator
from bayesgrasp.types import Scenes

DISTANCES = (0.45, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0)
TILTS = (0, 30, 55, 65, 70)
RODS = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0)
KINECT = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)
ABOVE = KINECT.with_pose(look_at(np.array([0.0, 0.0, 0.75]), np.zeros(3), up=np.array([0.0, 1.0, 0.0])))


@dataclass(frozen=True)
class Shape:
    """A mesh in the object frame."""

    vertices: np.ndarray
    faces: np.ndarray


def plate(width: float, depth: float, bottom: float, top: float) -> Shape:
    """A box around the z axis, between two heights, metres."""
    mesh = trimesh.creation.box((width, depth, top - bottom))
    mesh.apply_translation((0.0, 0.0, (bottom + top) / 2))
    return Shape(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32))


def scenes(n: int, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, index: int = 0) -> Scenes:
    """The same scene n times."""
    pose = np.tile(np.array([x, y, yaw], np.float32), (n, 1))
    return Scenes(np.full(n, index, np.int32), np.ones(n, np.float32), pose)


def wall_ratio(distance: float, degrees: float, images: int = 24, size: int = 96) -> float:
    """Measured over published standard deviation on a bare wall."""
    tilt = np.deg2rad(degrees)
    eye = distance * np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    pose = look_at(eye, np.zeros(3), up=np.array([0.0, 1.0, 0.0]))
    camera = Camera(size, size, KINECT.fx, KINECT.fy, (size - 1) / 2, (size - 1) / 2, pose)
    sensor = DepthSensor([plate(0.1, 0.1, 0.0, 0.1)], camera)
    true = sensor.render_clean(scenes(1, 50.0))[0].astype(np.float64)
    rays = camera.rays()
    sigma = axial_sigma(true, np.arccos(abs(rays @ camera.pose[2, :3]) / np.linalg.norm(rays, axis=-1)))
    seen = sensor.render(scenes(images, 50.0), None, generator(1))
    return float(((seen - true) / sigma)[seen > 0].std())


def draw_laws(target: Path) -> dict[str, object]:
    """Spread against distance for every tilt, and the depths that a flat wall shows."""
    ratios = {tilt: [wall_ratio(distance, tilt) for distance in DISTANCES] for tilt in TILTS}
    figure = Figure(figsize=(11, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    fine = np.linspace(0.45, 3.0, 200)
    for tilt in TILTS:
        law = axial_sigma(fine, np.full(200, np.deg2rad(tilt)))
        (line,) = left.plot(fine, 1e3 * law, label=f"{tilt} degrees")
        at = axial_sigma(np.array(DISTANCES), np.full(len(DISTANCES), np.deg2rad(tilt)))
        left.plot(DISTANCES, 1e3 * at * ratios[tilt], "o", color=line.get_color())
    left.set(xlabel="distance (m)", ylabel="standard deviation (mm)", title="axial noise: law (lines), images (dots)")
    left.legend(title="tilt")
    _draw_wall(right)
    figure.savefig(target / "laws.png", dpi=70)
    return {
        "spread_over_law": {str(tilt): dict(zip(map(str, DISTANCES), r, strict=True)) for tilt, r in ratios.items()}
    }


def _draw_wall(axes: Axes) -> None:
    camera = KINECT.with_pose(look_at(np.array([0.0, 0.0, 1.0]), np.zeros(3), up=np.array([0.0, 1.0, 0.0])))
    shown = DepthSensor([plate(0.1, 0.1, 0.0, 0.1)], camera).render(scenes(1, 50.0), None, generator(2))
    values, counts = np.unique(shown, return_counts=True)
    axes.vlines(values, 0, counts)
    allowed = 348 / (1091.5 - np.arange(700, 790))
    axes.plot(allowed, np.zeros_like(allowed), "|", color="tab:red", markersize=12, label="348 / (1091.5 - k)")
    axes.set(xlim=(0.985, 1.015), xlabel="depth (m)", ylabel="pixels", title="a flat wall at 1 m: all depths returned")
    axes.legend()


def rod_shares(upright: bool) -> list[float]:
    """Share of a rod's pixels that return the rod, for every width, at 0.6 m."""
    shares, rng = [], generator(3)
    for pixels in RODS:
        width = pixels * 0.6 / 580
        rod = plate(width, 0.2, 0.14, 0.15) if upright else plate(0.2, width, 0.14, 0.15)
        scene, sensor = scenes(20), DepthSensor([rod], ABOVE)
        scene.object_pose[:, :2] = rng.uniform(-0.02, 0.02, (20, 2))
        image, on_rod = sensor.render(scene, None, rng), sensor.render_clean(scene) < 0.65
        shares.append(float(((image > 0) & (image < 0.65))[on_rod].mean()))
    return shares


def draw_edges(target: Path) -> dict[str, object]:
    """The shadow and the edges of a block, and rods that vanish."""
    sensor = DepthSensor([plate(0.1, 0.1, 0.1, 0.15)], ABOVE)
    images = sensor.render(scenes(20), None, generator(4))
    rows = images[:, 205:275]
    near = ((rows > 0) & (rows < 0.68))[:, :, 320:].sum(-1)
    missing = rows == 0
    upright, level = rod_shares(True), rod_shares(False)
    figure = Figure(figsize=(11, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    _show(left, images[0, 170:310, 220:420], "a block 0.60 m away over a table at 0.75 m")
    right.plot(RODS, upright, "o-", label="along image columns")
    right.plot(RODS, level, "s-", label="along image rows")
    right.set(xlabel="width of the rod (px)", ylabel="share of its pixels returned", title="thin parts vanish")
    right.legend()
    figure.savefig(target / "edges.png", dpi=70)
    return {
        "shadow_px": {
            "left": float(missing[:, :, :320].sum(-1).mean()),
            "right": float(missing[:, :, 320:].sum(-1).mean()),
            "law": float(shadow_width(580.0, 0.075, np.array([0.6]), np.array([0.75]))[0]),
        },
        "edge_deviation_px": {"measured": float(near.std()), "law": float(lateral_sigma(np.zeros(1))[0])},
        "rod_share_returned": {"px": RODS, "upright": upright, "level": level},
    }


def draw_scenes(target: Path) -> None:
    """Household objects: true depth, the sensor's image, and the network's image."""
    names = ("household_coffee_mug", "household_hammer", "household_wine_glass", "household_tea_box")
    solids = [household.OBJECTS[name].build().mesh for name in names if name in household.OBJECTS]
    sensor = DepthSensor([Shape(s.vertices, s.faces) for s in solids])
    figure = Figure(figsize=(3 * len(solids), 7), layout="constrained")
    axes = figure.subplots(3, len(solids), squeeze=False)
    for i in range(len(solids)):
        scene, rng = scenes(1, 0.0, 0.0, 0.9, i), generator(5, i)
        clean, noisy = sensor.render_clean(scene)[0], sensor.render(scene, None, rng)[0]
        for row, image in enumerate((clean[160:340, 220:420], noisy[160:340, 220:420], preprocess(noisy))):
            _show(axes[row, i], image, ("true", "sensor", "network input")[row])
    figure.savefig(target / "scenes.png", dpi=60)


def draw_stereo(target: Path) -> dict[str, object]:
    """The same scenes by the Kinect and by the stereo pair, and the stereo pair against its laws."""
    names = ("household_coffee_mug", "household_hammer", "household_wine_glass", "household_tea_box")
    solids = [household.OBJECTS[name].build().mesh for name in names]
    shapes, config = [Shape(s.vertices, s.faces) for s in solids], StereoConfig()
    sensors = {"Kinect": DepthSensor(shapes), "stereo": DepthSensor(shapes, config=config)}
    figure = Figure(figsize=(3 * len(solids), 7), layout="constrained")
    axes = figure.subplots(3, len(solids), squeeze=False)
    for i in range(len(solids)):
        views = {
            kind: sensor.render(scenes(1, 0.0, 0.0, 0.9, i), None, generator(7, i))[0]
            for kind, sensor in sensors.items()
        }
        for row, (kind, image) in enumerate(views.items()):
            _show(axes[row, i], image[150:350, 210:430], kind)
        _show(axes[2, i], preprocess(views["stereo"]), "stereo, network input")
    figure.savefig(target / "stereo.png", dpi=60)
    return {"stereo": {"spread_over_law": _stereo_spread(), **_stereo_block(config)}}


def _stereo_spread() -> dict[str, float]:
    """Measured over stated standard deviation of a wall that faces the camera, where texture is even."""
    config, ratios = StereoConfig(texture_spread=0.0), {}
    for index, distance in enumerate(DISTANCES):
        camera = KINECT.with_pose(look_at(np.array([0.0, 0.0, distance]), np.zeros(3), up=np.array([0.0, 1.0, 0.0])))
        sensor = DepthSensor([plate(0.1, 0.1, 0.0, 0.1)], camera, config)
        seen = sensor.render(scenes(4, 50.0), None, generator(8, index))[:, 100:380, 100:500]
        error = (seen - distance)[seen > 0]
        ratios[str(distance)] = float(error.std() / stereo_sigma(config, np.array([distance]))[0])
    return ratios


def _stereo_block(config: StereoConfig) -> dict[str, object]:
    """Holes and growth of a block 0.60 m away over a table at 0.75 m, and the share of blobs on that table."""
    images = DepthSensor([plate(0.1, 0.1, 0.1, 0.15)], ABOVE, config).render(scenes(20), None, generator(9))
    even = DepthSensor([plate(0.1, 0.1, 0.1, 0.15)], ABOVE, StereoConfig(texture_spread=0.0))
    rows = even.render(scenes(20), None, generator(9))[:, 205:275, 200:440]
    near, missing = (rows > 0) & (rows < 0.68), rows == 0
    return {
        "hole_px": {
            "left": float(missing[:, :, :120].sum(-1).mean()),
            "right": float(missing[:, :, 120:].sum(-1).mean()),
            "law": float(hole_width(config, np.array([0.6]), np.array([0.75]))[0]),
        },
        "growth_px": {
            "mean": float(near.sum(-1).mean() / 2 - 48.3),
            "deviation": float(near[:, :, 120:].sum(-1).std()),
        },
        "blobs_on_table": float((images[:, :100, :560] == 0).mean()),
    }


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
        _show(axes[0, i], image[v - 60 : v + 60, u - 60 : u + 60], f"real {i}")
    u, v = np.rint(camera.project(np.zeros(3))[0]).astype(int)
    _show(axes[0, 4], model[v - 60 : v + 60, u - 60 : u + 60], "model, a block there")
    for i, image in enumerate(images):
        seen = to_canonical_view(image, camera)
        _show(axes[1, i], seen[170:350, 200:440], f"real {i}, canonical camera")
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


def _show(axes: Axes, image: Float[np.ndarray, "h w"], title: str) -> None:
    low, high = np.percentile(image[image > 0], [1, 99])
    axes.imshow(np.where(image > 0, image, np.nan), cmap="turbo", vmin=low, vmax=high, interpolation="nearest")
    axes.set(facecolor="black", title=title, xticks=[], yticks=[])


def main() -> None:
    """Measure and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real-depth", type=Path, default=None)
    parser.add_argument("--docs", type=Path, default=Path("docs/depth_sensor"))
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()

    options.docs.mkdir(parents=True, exist_ok=True)
    report = draw_laws(options.docs) | draw_edges(options.docs)
    draw_scenes(options.docs)
    report |= draw_stereo(options.docs)
    if options.real_depth is not None:
        report |= draw_real(options.real_depth, options.docs)
    print(json.dumps(report, indent=1))
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
