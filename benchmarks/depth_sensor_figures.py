"""Measure the sensor model against the published laws, and draw the figures of docs/depth_sensor.md.

python benchmarks/depth_sensor_figures.py [--real-depth DIR] [--docs docs/depth_sensor] [--json FILE]

`--real-depth` is a directory with depth_<i>.npy, segmask_<i>.png and camera.json of a real structured-light camera;
without it, the comparison with real images is left out.
"""

from __future__ import annotations

import json as json_module
from pathlib import Path

import numpy as np
import tyro
from depth_real import draw_real
from depth_scenes import ABOVE, KINECT, plate, scenes, show
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bayesgrasp.depth.kinect import DEPTH_CONSTANT, axial_sigma, lateral_sigma, steep_sigma
from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.depth.stereo import StereoConfig
from bayesgrasp.files import write_json
from bayesgrasp.geometry.camera import Camera, look_at
from bayesgrasp.objects import household
from bayesgrasp.observation.preprocess import preprocess
from bayesgrasp.seeding import generator

DISTANCES = (0.45, 0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0)
TILTS = (0, 30, 55, 65, 70)
SHOWN = ("household_coffee_mug", "household_hammer", "household_wine_glass", "household_tea_box")
RODS = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0)


@np.vectorize
def published_sigma(depth: float, tilt: float) -> float:
    """Standard deviation of a Kinect's depth by the published law, metres; of a depth (m) and a tilt (radians)."""
    deviation: float = axial_sigma(depth, steep_sigma(DEPTH_CONSTANT / depth, np.cos(tilt)))
    return deviation


def hidden_width(focal_length: float, baseline: float, near: float, far: float) -> float:
    """Width (px) of what an edge at depth `near` hides from the second eye on a wall at depth `far` (m): f b / z."""
    return focal_length * abs(baseline) * (1 / near - 1 / far)


def wall_ratio(distance: float, degrees: float, images: int = 24, size: int = 96) -> float:
    """Measured over published standard deviation on a bare wall."""
    tilt = np.deg2rad(degrees)
    eye = distance * np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    pose = look_at(eye, np.zeros(3), up=np.array([0.0, 1.0, 0.0]))
    camera = Camera(size, size, KINECT.fx, KINECT.fy, (size - 1) / 2, (size - 1) / 2, pose)
    sensor = DepthSensor([plate(0.1, 0.1, 0.0, 0.1)], camera)
    true = sensor.render_clean(scenes(1, 50.0))[0].astype(np.float64)
    rays = camera.rays()
    sigma = published_sigma(true, np.arccos(abs(rays @ camera.pose[2, :3]) / np.linalg.norm(rays, axis=-1)))
    seen = sensor.render(scenes(images, 50.0), None, generator(1))
    return float(((seen - true) / sigma)[seen > 0].std())


def draw_laws(target: Path) -> dict[str, object]:
    """Spread against distance for every tilt, and the depths that a flat wall shows."""
    ratios = {tilt: [wall_ratio(distance, tilt) for distance in DISTANCES] for tilt in TILTS}
    figure = Figure(figsize=(11, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    fine = np.linspace(0.45, 3.0, 200)
    for tilt in TILTS:
        law = published_sigma(fine, np.deg2rad(tilt))
        (line,) = left.plot(fine, 1e3 * law, label=f"{tilt} degrees")
        at = published_sigma(np.array(DISTANCES), np.deg2rad(tilt))
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
    show(left, images[0, 170:310, 220:420], "a block 0.60 m away over a table at 0.75 m")
    right.plot(RODS, upright, "o-", label="along image columns")
    right.plot(RODS, level, "s-", label="along image rows")
    right.set(xlabel="width of the rod (px)", ylabel="share of its pixels returned", title="thin parts vanish")
    right.legend()
    figure.savefig(target / "edges.png", dpi=70)
    return {
        "shadow_px": {
            "left": float(missing[:, :, :320].sum(-1).mean()),
            "right": float(missing[:, :, 320:].sum(-1).mean()),
            "law": hidden_width(580.0, 0.075, 0.6, 0.75),
        },
        "edge_deviation_px": {"measured": float(near.std()), "law": lateral_sigma(0.0)},
        "rod_share_returned": {"px": RODS, "upright": upright, "level": level},
    }


def draw_scenes(target: Path) -> None:
    """Household objects: true depth, the sensor's image, and the network's image."""
    solids = [household.OBJECTS[name].build().mesh for name in SHOWN]
    sensor = DepthSensor(solids)
    figure = Figure(figsize=(3 * len(solids), 7), layout="constrained")
    axes = figure.subplots(3, len(solids), squeeze=False)
    for i in range(len(solids)):
        scene, rng = scenes(1, 0.0, 0.0, 0.9, i), generator(5, i)
        clean, noisy = sensor.render_clean(scene)[0], sensor.render(scene, None, rng)[0]
        for row, image in enumerate((clean[160:340, 220:420], noisy[160:340, 220:420], preprocess(noisy))):
            show(axes[row, i], image, ("true", "sensor", "network input")[row])
    figure.savefig(target / "scenes.png", dpi=60)


def draw_stereo(target: Path) -> dict[str, object]:
    """The same scenes by the Kinect and by the stereo pair, and the stereo pair against its laws."""
    solids, config = [household.OBJECTS[name].build().mesh for name in SHOWN], StereoConfig()
    sensors = {"Kinect": DepthSensor(solids), "stereo": DepthSensor(solids, config=config)}
    figure = Figure(figsize=(3 * len(solids), 7), layout="constrained")
    axes = figure.subplots(3, len(solids), squeeze=False)
    for i in range(len(solids)):
        views = {
            kind: sensor.render(scenes(1, 0.0, 0.0, 0.9, i), None, generator(7, i))[0]
            for kind, sensor in sensors.items()
        }
        for row, (kind, image) in enumerate(views.items()):
            show(axes[row, i], image[150:350, 210:430], kind)
        show(axes[2, i], preprocess(views["stereo"]), "stereo, network input")
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
        law = distance**2 * config.subpixel / (config.focal_length * abs(config.baseline))
        ratios[str(distance)] = float(error.std() / law)
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
            "law": hidden_width(config.focal_length, config.baseline, 0.6, 0.75),
        },
        "growth_px": {
            "mean": float(near.sum(-1).mean() / 2 - 48.3),
            "deviation": float(near[:, :, 120:].sum(-1).std()),
        },
        "blobs_on_table": float((images[:, :100, :560] == 0).mean()),
    }


def main(real_depth: Path | None = None, docs: Path = Path("docs/depth_sensor"), json: Path | None = None) -> None:
    """Measure and draw.

    Args:
        real_depth: Directory of real depth images.
        docs: Where the figures go.
        json: Where to write the numbers.
    """
    docs.mkdir(parents=True, exist_ok=True)
    report = draw_laws(docs) | draw_edges(docs)
    draw_scenes(docs)
    report |= draw_stereo(docs)
    if real_depth is not None:
        report |= draw_real(real_depth, docs)
    print(json_module.dumps(report, indent=1))
    if json is not None:
        write_json(json, report)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
