"""Scenes for tests of the eye: plates, walls, scans, and a ray caster that shares no code with the package's own."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from pixels import cropped, in_world

from bayesgrasp.geometry.camera import Camera, look_at
from bayesgrasp.types import CameraNuisances, Scenes

FAR_AWAY = 50.0
KINECT = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)


@dataclass(frozen=True)
class Shape:
    vertices: np.ndarray
    faces: np.ndarray

    @property
    def wound_inwards(self) -> "Shape":
        return Shape(self.vertices, self.faces[:, ::-1].copy())


def plate(width: float, depth: float, bottom: float, top: float) -> Shape:
    """A box of width x depth metres around the z axis, between two heights."""
    mesh = trimesh.creation.box((width, depth, top - bottom))
    mesh.apply_translation((0.0, 0.0, (bottom + top) / 2))
    return Shape(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32))


def scan(path: Path) -> Shape:
    """A mesh file exactly as it is, put on the table."""
    mesh = trimesh.load_mesh(path, process=False)
    vertices = np.array(mesh.vertices)
    middle = (vertices.max(0) + vertices.min(0)) / 2
    return Shape(vertices - [*middle[:2], vertices[:, 2].min()], np.array(mesh.faces, dtype=np.int32))


def scenes(n: int, pose: tuple[float, float, float] = (0.0, 0.0, 0.0), scale: float = 1.0, index: int = 0) -> Scenes:
    return Scenes(
        object_index=np.full(n, index, np.int32),
        scale=np.full(n, scale, np.float32),
        object_pose=np.tile(np.array(pose, np.float32), (n, 1)),
    )


def random_scenes(n: int, objects: int, rng: np.random.Generator) -> Scenes:
    return Scenes(
        object_index=rng.integers(objects, size=n, dtype=np.int32),
        scale=rng.uniform(0.9, 1.1, n).astype(np.float32),
        object_pose=rng.uniform([-0.1, -0.1, -np.pi], [0.1, 0.1, np.pi], (n, 3)).astype(np.float32),
    )


def random_cameras(n: int, rng: np.random.Generator) -> CameraNuisances:
    return CameraNuisances(
        position_offset=rng.normal(0, 0.01, (n, 3)).astype(np.float32),
        rotation_vector=rng.normal(0, [0.002, 0.01, 0.002], (n, 3)).astype(np.float32),
        near=rng.uniform(0.441, 0.459, n).astype(np.float32),
        far=rng.uniform(0.98, 1.02, n).astype(np.float32),
        field_of_view_factor=rng.uniform(0.98, 1.02, n).astype(np.float32),
    )


def from_above(height: float, width: int = 640, rows: int = 480) -> Camera:
    """A camera that looks straight down, or the middle part of its image."""
    pose = look_at(np.array([0.0, 0.0, height]), np.zeros(3), up=np.array([0.0, 1.0, 0.0]))
    return cropped(KINECT, (640 - width) // 2, (480 - rows) // 2, width, rows).with_pose(pose)


def at_wall(distance: float, tilt: float, size: int = 96) -> Camera:
    """The middle of an image of the bare table seen from a distance along a line at a tilt to its normal."""
    eye = distance * np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    pose = look_at(eye, np.zeros(3), up=np.array([0.0, 1.0, 0.0]))
    return cropped(KINECT, 320 - size // 2, 240 - size // 2, size, size).with_pose(pose)


def cast_depth(shape: Shape, scene: Scenes, camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """Depths (m) of pixels (n, 2) of a one-row `Scenes`: Moeller-Trumbore in the world frame, double precision."""
    x, y, yaw = scene.object_pose[0].astype(float)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    vertices = shape.vertices * float(scene.scale[0]) @ turn.T + [x, y, 0]
    origin = camera.pose[:3, 3]
    rays = in_world(camera, pixels, np.ones(len(pixels))) - origin
    with np.errstate(divide="ignore"):
        table = np.where(rays[:, 2] < 0, -origin[2] / rays[:, 2], np.inf)
    a, b, c = (vertices[shape.faces[:, k]] for k in range(3))
    edge_b, edge_c, to_origin = b - a, c - a, origin - a
    q = np.cross(to_origin, edge_b)
    reach = np.einsum("fi,fi->f", edge_c, q)
    depths = table.copy()
    for i, ray in enumerate(rays):
        p = np.cross(ray, edge_c)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1 / np.einsum("fi,fi->f", edge_b, p)
            s, t = np.einsum("fi,fi->f", to_origin, p) * scale, q @ ray * scale
            z = reach * scale
            hits = z[(s >= 0) & (t >= 0) & (s + t <= 1) & (z > 0)]
        depths[i] = min(depths[i], hits.min(initial=np.inf))
    return np.where(np.isfinite(depths), depths, 0.0)
