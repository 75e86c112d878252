"""``bayesgrasp render``: what the depth camera sees of an object, as files that `bayesgrasp plan` reads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from jaxtyping import Float32
from matplotlib.figure import Figure
from numpy import ndarray

from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.errors import AssetError, InvalidConfigurationError
from bayesgrasp.files import make_directory, write_through
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.geometry.camera_nuisances import disturbed_camera
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.observation.depth_files import write_depth_png
from bayesgrasp.prior.nuisance import CameraPrior
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import CameraNuisances, Scenes

FARTHEST_PLACE = 0.5
"""An object further than this from the middle of the table, along x or y, is out of the canonical camera's view (m)."""
FARTHEST_DEPTH = 65.0
"""16 bits of millimetres end here; the bare table towards the horizon is further away (m)."""


@dataclass(frozen=True)
class OneObject:
    """Which object.

    Attributes:
        object: As `bayesgrasp objects list` names it.
        ycb_dir: Directory of YCB scans; by default $BAYESGRASP_YCB_DIR.
        mesh: A mesh file of your own instead, in metres with z upwards.
        mass: Its mass in kilograms.
    """

    object: str | None = None
    ycb_dir: Path | None = None
    mesh: Path | None = None
    mass: float | None = None

    def load(self) -> ObjectAsset:
        """Load it."""
        if (self.object is None) == (self.mesh is None):
            raise AssetError("name either one object, or a file: `--object ID`, or `--mesh FILE --mass KG`")
        return load_objects([self.object] if self.object is not None else (), self.ycb_dir, self.mesh, self.mass)[0]


def render(
    out: Path,
    which: Annotated[OneObject, tyro.conf.OmitArgPrefixes] = OneObject(),
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
    scale: float = 1.0,
    seed: int = 0,
    camera: Path | None = None,
    disturb: bool = False,
) -> None:
    """Render the depth image of an object on the table.

    Writes depth.png (16 bits, millimetres) and depth.npy (metres) with the noise of the sensor, clean.png and clean.npy
    without, picture.png of both in colour, and camera.json.

    Args:
        out: Directory for the files.
        which: Which object.
        pose: Its place x and y on the table in metres, and its turn about the vertical in radians.
        scale: Its size, as a factor.
        seed: Same seed, same image.
        camera: Another camera than the benchmark's: JSON with `intrinsics` and `camera_to_world`.
        disturb: Draw the camera's errors of pose, range and field of view from their prior.
    """
    scene = _scene(pose, scale)
    asset = which.load()
    nominal = canonical_camera() if camera is None else Camera.load(camera)
    rng = generator(seed, Stream.RENDERED_NOISE)
    nuisance = _drawn(nominal, seed) if disturb else None
    sensor = DepthSensor([asset], nominal)
    clean, noisy = sensor.render_clean(scene, nuisance)[0], sensor.render(scene, nuisance, rng)[0]
    actual = nominal if nuisance is None else disturbed_camera(nominal, nuisance, 0)
    _write(out, clean, noisy, actual, f"{asset.id} at {pose}, scale {scale}")
    print(f"{asset.id}: depth.png, depth.npy, clean.png, clean.npy, picture.png and camera.json are in {out}")


def _scene(pose: tuple[float, float, float], scale: float) -> Scenes:
    if not all(np.isfinite(pose)) or max(abs(pose[0]), abs(pose[1])) > FARTHEST_PLACE:
        raise InvalidConfigurationError(
            f"--pose is x y yaw in metres and radians, with x and y between {-FARTHEST_PLACE} and {FARTHEST_PLACE}; "
            f"got {' '.join(map(str, pose))}"
        )
    if not 0.1 <= scale <= 10:
        raise InvalidConfigurationError(f"--scale must be between 0.1 and 10, got {scale}")
    return Scenes(np.zeros(1, np.int32), np.array([scale], np.float32), np.array([pose], np.float32))


def _drawn(nominal: Camera, seed: int) -> CameraNuisances:
    x, y, z = nominal.pose[:3, 3].tolist()
    return CameraPrior(position=(x, y, z)).sample(1, generator(seed, Stream.RENDERED_CAMERA))


def _write(
    out: Path, clean: Float32[ndarray, "h w"], noisy: Float32[ndarray, "h w"], camera: Camera, title: str
) -> None:

    make_directory(out)
    for name, image in (("depth", noisy), ("clean", np.where(clean < FARTHEST_DEPTH, clean, np.float32(0)))):
        write_depth_png(out / f"{name}.png", image)
        write_through(out / f"{name}.npy", partial(np.save, arr=image))
    camera.save(out / "camera.json")
    picture = _picture(clean, noisy, title)
    write_through(out / "picture.png", lambda file: picture.savefig(file, format="png", dpi=100))


def _picture(clean: Float32[ndarray, "h w"], noisy: Float32[ndarray, "h w"], title: str) -> Figure:
    figure = Figure(figsize=(13, 5), layout="constrained")
    seen = noisy[noisy > 0]
    limits = {"vmin": seen.min(), "vmax": np.percentile(seen, 99)} if seen.size else {}
    for place, (name, image) in enumerate((("true depth", clean), ("as the sensor returns it", noisy)), start=1):
        axes = figure.add_subplot(1, 2, place)
        drawn = axes.imshow(np.where(image > 0, image, np.nan), cmap="turbo", interpolation="nearest", **limits)
        axes.set(facecolor="black", title=name, xlabel="column (px)", ylabel="row (px)")
    figure.colorbar(drawn, ax=figure.axes, label="depth (m); black: no return")
    figure.suptitle(title)
    return figure
