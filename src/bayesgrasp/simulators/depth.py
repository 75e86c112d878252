"""The sensor model p(i | O, p_O, camera) of section 4.1: depth images of one object on a table by a Kinect v1.

An image is made in three passes: rays to the object at full resolution (`mesh_tree`, `ray_kernels`), matching and
shadow (`light_kernels`), and the noise of the device (`kinect`). `images` evaluates the last two only at the pixels
that the networks' resized image consists of; it gives exactly what `preprocess(render(...))` gives with the same
generator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from jaxtyping import Float, Float32, Int64
from scipy.spatial.transform import Rotation

from bayesgrasp.errors import DepthImageError, InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.simulators import light_kernels as light
from bayesgrasp.simulators import ray_kernels as rays
from bayesgrasp.simulators.kinect import KinectConfig
from bayesgrasp.simulators.mesh_tree import MeshTree
from bayesgrasp.simulators.preprocess import IMAGE_SHAPE, SENSOR_SHAPE, clip_range, sampled_columns, sampled_rows
from bayesgrasp.types import CameraNuisances, Scenes


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
        config: Constants of the sensor.

    Raises:
        AssetError: An object's mesh cannot be seen.
        DepthImageError: The camera has no pose.
    """

    def __init__(
        self, objects: Sequence[Visible], camera: Camera | None = None, config: KinectConfig | None = None
    ) -> None:
        self.camera = canonical_camera() if camera is None else camera
        self.config = KinectConfig() if config is None else config
        self._trees = tuple(MeshTree(o.vertices, o.faces) for o in objects)
        self._constants = self.config.constants
        self.camera.pose  # noqa: B018  refuses a camera without a pose here, not at the first image

    def render_clean(self, scenes: Scenes, cameras: CameraNuisances | None = None) -> Float32[np.ndarray, "n h w"]:
        """True depths, metres, without the sensor: 0 where there is neither object nor table.

        Args:
            scenes: n scenes.
            cameras: n cameras; the nominal one unless given. `near` and `far` are not applied.
        """
        images = np.empty((len(scenes), self.camera.height, self.camera.width), np.float32)
        for i, image in enumerate(images):
            tree, view, _, _ = self._setup(scenes, cameras, i)
            spans, _ = self._spans(tree, view, False)
            region = self._region(tree, view, spans, (0, self.camera.height, 0, self.camera.width))
            with np.errstate(divide="ignore"):
                image[:] = np.where(region.inverse_depth > 0, 1 / region.inverse_depth, 0.0)
        return images

    def render(
        self, scenes: Scenes, cameras: CameraNuisances | None, rng: np.random.Generator
    ) -> Float32[np.ndarray, "n h w"]:
        """Depth images as the device returns them, metres, 0 = no return; arguments as in `render_clean`."""
        rows, columns = np.arange(self.camera.height), np.arange(self.camera.width)
        images = np.empty((len(scenes), len(rows), len(columns)), np.float32)
        for i in range(len(scenes)):
            self._sense(scenes, cameras, i, rng, rows, columns, images[i])
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
        rows, columns = sampled_rows(), sampled_columns()
        images = np.empty((len(scenes), *IMAGE_SHAPE), np.float32)
        for i in range(len(scenes)):
            self._sense(scenes, cameras, i, rng, rows, columns, images[i])
        return clip_range(images)

    def _sense(
        self,
        scenes: Scenes,
        cameras: CameraNuisances | None,
        index: int,
        rng: np.random.Generator,
        rows: Int64[np.ndarray, "r"],
        columns: Int64[np.ndarray, "c"],
        image: Float32[np.ndarray, "r c"],
    ) -> None:
        tree, view, near, far = self._setup(scenes, cameras, index)
        constants, shape = self._constants, (self.camera.height, self.camera.width)
        axial = _lattice(rng, constants.noise_pitch, shape)
        light.sense_table(view, tree.planes, constants, axial, near, far, rows, columns, image)
        spans, shaded = self._spans(tree, view, self.config.shadow)
        margin = light.REACH + constants.half_window
        box = self._near_object(view, shaded, margin)
        if box == rays.NOWHERE:
            return
        region = self._region(tree, view, spans, _widened(box, margin, shape))
        local = _lattice(rng, constants.noise_pitch, region.plane.shape, layers=3)
        of_rows, of_columns = _between(rows, *box[:2]), _between(columns, *box[2:])
        rows, columns = rows[of_rows], columns[of_columns]
        part = image[of_rows, of_columns]
        matches = light.match(view, tree.planes, region, local, constants, shaded, rows, columns, self.config.shadow)
        blocked = tree.occluded(matches.origins, matches.directions)
        corner = (region.row, region.column)
        light.sense_matches(matches, blocked, constants, axial, local[2], corner, near, far, rows, columns, part)

    def _setup(
        self, scenes: Scenes, cameras: CameraNuisances | None, index: int
    ) -> tuple[MeshTree, rays.View, float, float]:
        """The tree of a scene, its view from its camera, and the range of that camera (metres)."""
        camera, near, far = self.camera, 0.0, np.inf
        if cameras is not None:
            camera = disturbed(self.camera, cameras, index)
            near, far = float(cameras.near[index]), float(cameras.far[index])
        view = object_view(camera, scenes.object_pose[index], float(scenes.scale[index]), self.config.baseline)
        return self._trees[scenes.object_index[index]], view, near, far

    def _spans(
        self, tree: MeshTree, view: rays.View, shadow: bool
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

    def _near_object(self, view: rays.View, shaded: Int64[np.ndarray, "h 2"], margin: int) -> tuple[int, ...]:
        """Box (top, bottom, left, right) outside which an image shows the bare table, at tilts that always return."""
        height, width = self.camera.height, self.camera.width
        for u in (0, width - 1):
            for v in (0, height - 1):
                ray = view.ray_matrix @ (u, v, 1.0)
                if -ray[2] < np.cos(self.config.grazing_start) * np.linalg.norm(ray):
                    return 0, height, 0, width
        return rays.bounding_box(shaded, width, margin)

    def _region(
        self, tree: MeshTree, view: rays.View, spans: Int64[np.ndarray, "h 2"], box: tuple[int, ...]
    ) -> rays.Region:
        origins, directions = rays.primary_rays(view, spans)
        return rays.resolve(view, tree.planes, spans, tree.first_hit(origins, directions), box)


def disturbed(camera: Camera, cameras: CameraNuisances, index: int) -> Camera:
    """The nominal camera with the position, orientation and field of view of row `index` (see `CameraNuisances`)."""
    pose = camera.pose.copy()
    pose[:3, 3] += cameras.position_offset[index]
    pose[:3, :3] @= Rotation.from_rotvec(cameras.rotation_vector[index].astype(np.float64)).as_matrix()
    factor = float(cameras.field_of_view_factor[index])
    return replace(
        camera,
        fx=_focal_length(camera.fx, camera.width, factor),
        fy=_focal_length(camera.fy, camera.height, factor),
        camera_to_world=pose,
    )


def _focal_length(nominal: float, size: int, factor: float) -> float:
    """Focal length (px) of a field of view (angle) that is `factor` times the nominal one."""
    half_angle = factor * np.arctan(size / 2 / nominal)
    if not 0 < half_angle < np.pi / 2:
        raise InvalidConfigurationError(
            f"a field_of_view_factor of {factor} makes the field of view {np.rad2deg(2 * half_angle):.1f} degrees; "
            "it must be between 0 and 180"
        )
    return float(size / 2 / np.tan(half_angle))


def object_view(camera: Camera, object_pose: Float[np.ndarray, "3"], scale: float, baseline: float) -> rays.View:
    """A camera and its projector in the frame of an object at (x, y, yaw) and scale beta."""
    x, y, yaw = (float(value) for value in object_pose)
    world_to_object = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    camera_to_object = world_to_object @ camera.pose[:3, :3] / scale
    origin = world_to_object @ (camera.pose[:3, 3] - (x, y, 0.0)) / scale
    ray_matrix = np.ascontiguousarray(camera_to_object @ np.linalg.inv(camera.matrix))
    return rays.View(ray_matrix, origin, origin + camera_to_object[:, 0] * baseline)


def _lattice(
    rng: np.random.Generator, pitch: int, shape: tuple[int, ...], layers: int | None = None
) -> Float32[np.ndarray, "*layers h w"]:
    """Independent standard normal numbers, one every `pitch` pixels, enough to interpolate at every pixel."""
    size = (shape[0] // pitch + 2, shape[1] // pitch + 2)
    return rng.standard_normal(size if layers is None else (layers, *size), dtype=np.float32)


def _widened(box: tuple[int, ...], margin: int, shape: tuple[int, int]) -> tuple[int, int, int, int]:
    top, bottom, left, right = box
    return max(0, top - margin), min(shape[0], bottom + margin), max(0, left - margin), min(shape[1], right + margin)


def _between(sorted_indices: Int64[np.ndarray, "n"], start: int, stop: int) -> slice:
    first, end = np.searchsorted(sorted_indices, [start, stop])
    return slice(int(first), int(end))
