"""The sensor model p(i | O, p_O, camera) of section 4.1: depth images of one object on a table, as by a Kinect v1.

An image is made in three passes: rays to the object at full resolution (`mesh_tree`, `ray_kernels`), matching and
shadow, and the noise of the device (`devices`: a Kinect, or a stereo pair). `images` evaluates the last two only at the
pixels that the networks' resized image consists of; it gives exactly what `preprocess(render(...))` gives with the same
generator.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, Int64

from bayesgrasp.depth import ray_kernels as rays
from bayesgrasp.depth.devices import SensorConfig, device_of
from bayesgrasp.depth.frame import Frame, Limits, ObjectRegion, Pixels, Region, View
from bayesgrasp.depth.kinect import KinectConfig
from bayesgrasp.depth.mesh_tree import MeshTree
from bayesgrasp.depth.views import Views, object_views
from bayesgrasp.errors import DepthImageError, InvalidConfigurationError
from bayesgrasp.geometry.camera import IMAGE_SHAPE, Camera, canonical_camera
from bayesgrasp.observation.preprocess import FAR, NEAR, SENSOR_SHAPE, sampled_columns, sampled_rows
from bayesgrasp.types import CameraNuisances, Scenes


@runtime_checkable
class Visible(Protocol):
    """What the sensor needs of an object: a triangle mesh in the object frame, metres."""

    @property
    def vertices(self) -> np.ndarray:
        """Vertices, (v, 3)."""

    @property
    def faces(self) -> np.ndarray:
        """Vertex indices of triangles, (f, 3)."""


class DepthSensor:
    """Renders depth images of scenes with one of the given objects.

    Args:
        objects: The ordered set that `Scenes.object_index` refers to.
        camera: Nominal camera with a pose; the canonical one unless given.
        config: Constants of the sensor, which also say of what kind it is: `KinectConfig` (the default) or
            `StereoConfig`.

    Raises:
        AssetError: An object's mesh cannot be seen.
        DepthImageError: The camera has no pose.
    """

    def __init__(
        self, objects: Sequence[Visible], camera: Camera | None = None, config: SensorConfig | None = None
    ) -> None:
        self.camera = canonical_camera() if camera is None else camera
        self.config = KinectConfig() if config is None else config
        self._trees = tuple(MeshTree(o.vertices, o.faces) for o in objects)
        self._device = device_of(self.config)
        self.camera.pose  # noqa: B018  refuses a camera without a pose here, not at the first image

    def of_make(self, config: SensorConfig) -> DepthSensor:
        """The same objects and nominal camera with another make of sensor; the trees of the meshes are shared."""
        other = copy.copy(self)
        other.config, other._device = config, device_of(config)
        return other

    def render_clean(
        self, scenes: Scenes, cameras: CameraNuisances | None = None
    ) -> Float32[np.ndarray, "n {self.camera.height} {self.camera.width}"]:
        """True depths, metres, without the sensor: 0 where there is neither object nor table.

        Args:
            scenes: n scenes.
            cameras: n cameras; the nominal one unless given. `near` and `far` are not applied.
        """
        views = self._views(scenes, cameras)
        images = np.empty((len(scenes), self.camera.height, self.camera.width), np.float32)
        for i, image in enumerate(images):
            tree = self._trees[scenes.object_index[i]]
            spans, _ = self._spans(tree, views[i], False)
            region = self._region(tree, views[i], spans, (0, self.camera.height, 0, self.camera.width))
            with np.errstate(divide="ignore"):
                image[:] = np.where(region.inverse_depth > 0, 1 / region.inverse_depth, 0.0)
        return images

    def render(
        self, scenes: Scenes, cameras: CameraNuisances | None, rng: np.random.Generator
    ) -> Float32[np.ndarray, "n {self.camera.height} {self.camera.width}"]:
        """Depth images as the device returns them, metres, 0 = no return; arguments as in `render_clean`."""
        return self.thinned(scenes, cameras, rng, 1)

    def thinned(
        self, scenes: Scenes, cameras: CameraNuisances | None, rng: np.random.Generator, step: int
    ) -> Float32[np.ndarray, "n h w"]:
        """Every `step`-th pixel of `render`'s images, each way, from the `step // 2`-th on; no other is evaluated."""
        views = self._views(scenes, cameras)
        rows, columns = (np.arange(step // 2, size, step) for size in (self.camera.height, self.camera.width))
        images = np.empty((len(scenes), len(rows), len(columns)), np.float32)
        for i, image in enumerate(images):
            limits = Limits(views.near[i], views.far[i], self.camera.width)
            self._sense(self._trees[scenes.object_index[i]], views[i], limits, Pixels(rows, columns, image), rng)
        return images

    def images(
        self, scenes: Scenes, cameras: CameraNuisances | None, rng: np.random.Generator
    ) -> Float32[np.ndarray, "n 160 256"]:
        """Network inputs, in {0} u [0.45, 1] m: `preprocess(render(scenes, cameras, rng))`, evaluated where needed.

        Raises:
            DepthImageError: The nominal camera is not 640x480.
        """
        if (self.camera.height, self.camera.width) != SENSOR_SHAPE:
            raise DepthImageError(f"network inputs come from a 640x480 camera, got {self.camera}")
        views = self._views(scenes, cameras)
        near, far = np.maximum(views.near, np.float32(NEAR)), np.minimum(views.far, np.float32(FAR))
        rows, columns = sampled_rows(), sampled_columns()
        images = np.empty((len(scenes), *IMAGE_SHAPE), np.float32)
        for i, image in enumerate(images):
            limits = Limits(near[i], far[i], self.camera.width)
            self._sense(self._trees[scenes.object_index[i]], views[i], limits, Pixels(rows, columns, image), rng)
        return images

    def _views(self, scenes: Scenes, cameras: CameraNuisances | None) -> Views:
        if len(scenes) and not 0 <= scenes.object_index.min() <= scenes.object_index.max() < len(self._trees):
            raise InvalidConfigurationError(
                f"object_index goes from {scenes.object_index.min()} to {scenes.object_index.max()}, "
                f"but this sensor has {len(self._trees)} objects"
            )
        if cameras is not None and len(cameras) != len(scenes):
            raise InvalidConfigurationError(f"{len(scenes)} scenes need as many cameras, got {len(cameras)}")
        return object_views(self.camera, scenes, cameras, self.config.baseline)

    def _sense(self, tree: MeshTree, view: View, limits: Limits, pixels: Pixels, rng: np.random.Generator) -> None:
        """Write what the device returns at the given rows and columns, 0 outside the limits of depth."""
        device, shape = self._device, (self.camera.height, self.camera.width)
        frame = Frame(view, limits, device.noise(rng, shape))
        device.sense_table(frame, pixels)
        spans, hidden = self._spans(tree, view, device.shadow)
        near = self._near_object(view, hidden, device.margin)
        box = rays.bounding_box(near, limits.width)
        if box == rays.NOWHERE:
            return
        region = self._region(tree, view, spans, _widened(box, device.margin, shape))
        around = ObjectRegion(tree.planes, region, near, hidden, device.local_noise(rng, region.plane.shape))
        part = _inside(pixels, box)
        matches = device.match(frame, around, part)
        blocked = tree.occluded(matches.origins, matches.directions)
        device.sense_matches(frame, around, part, matches, blocked)

    def _spans(
        self, tree: MeshTree, view: View, shadow: bool
    ) -> tuple[Int64[np.ndarray, "h 2"], Int64[np.ndarray, "h 2"]]:
        """Columns of each row where the object may be, and where the object or its shadow may be."""
        height, width = self.camera.height, self.camera.width
        count = len(tree.hull)
        pixels, in_front = rays.project_hull(view, tree.hull, shadow)
        if not in_front:
            everywhere = np.tile(np.array([0, width]), (height, 1))
            return everywhere, everywhere
        return (
            rays.row_spans(rays.outline(pixels[:count]), height, width),
            rays.row_spans(rays.outline(pixels), height, width),
        )

    def _near_object(self, view: View, hidden: Int64[np.ndarray, "h 2"], margin: int) -> Int64[np.ndarray, "h 2"]:
        """Columns of each row outside which an image shows the bare table, at tilts that always return."""
        height, width = self.camera.height, self.camera.width
        for u in (0, width - 1):
            for v in (0, height - 1):
                ray = view.ray_matrix @ (u, v, 1.0)
                if -ray[2] < np.cos(self._device.steepest) * np.linalg.norm(ray):
                    return np.tile(np.array([0, width]), (height, 1))
        widened: Int64[np.ndarray, "h 2"] = rays.widened(hidden, margin, width)
        return widened

    def _region(self, tree: MeshTree, view: View, spans: Int64[np.ndarray, "h 2"], box: tuple[int, ...]) -> Region:
        origins, directions = rays.primary_rays(view, spans)
        region: Region = rays.resolve(view, tree.planes, spans, tree.first_hit(origins, directions), box)
        return region


def _widened(box: tuple[int, ...], margin: int, shape: tuple[int, int]) -> tuple[int, int, int, int]:
    top, bottom, left, right = box
    return max(0, top - margin), min(shape[0], bottom + margin), max(0, left - margin), min(shape[1], right + margin)


def _inside(pixels: Pixels, box: tuple[int, int, int, int]) -> Pixels:
    """Those of the pixels that lie in a box; they are written to the same image."""
    top, bottom, left, right = box
    rows, columns = _between(pixels.rows, top, bottom), _between(pixels.columns, left, right)
    return Pixels(pixels.rows[rows], pixels.columns[columns], pixels.image[rows, columns])


def _between(sorted_indices: Int64[np.ndarray, "n"], start: int, stop: int) -> slice:
    first, end = np.searchsorted(sorted_indices, [start, stop])
    return slice(int(first), int(end))
