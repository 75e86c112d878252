"""Cameras of a batch of scenes, with their nuisances (paper, section 4.1), seen from the objects.

A disturbed camera stands at t + offset and is turned to R exp(eta); its field of view, an angle, is the nominal one
times a factor, both ways, so that its focal length is (size / 2) / tan(factor * atan(size / 2 / f)).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.simulators.ray_kernels import View
from bayesgrasp.types import CameraNuisances, Scenes


@dataclass(frozen=True)
class Views:
    """n cameras in the frames of n objects (scale 1); see `ray_kernels.View`.

    Attributes:
        ray_matrix: From homogeneous pixels to object-frame rays per metre of depth.
        origin: Cameras.
        projector: Projectors.
        near, far: Range of each camera, metres.
    """

    ray_matrix: Float64[np.ndarray, "n 3 3"]
    origin: Float64[np.ndarray, "n 3"]
    projector: Float64[np.ndarray, "n 3"]
    near: Float64[np.ndarray, "n"]
    far: Float64[np.ndarray, "n"]

    def __getitem__(self, index: int) -> View:
        return View(self.ray_matrix[index], self.origin[index], self.projector[index])


def object_views(camera: Camera, scenes: Scenes, cameras: CameraNuisances | None, baseline: float) -> Views:
    """The views of scenes.

    Args:
        camera: Nominal camera, with a pose.
        scenes: n scenes.
        cameras: n disturbances; the nominal camera without limits of range if None.
        baseline: From the camera to its projector along the camera's x axis, metres.
    """
    count = len(scenes)
    rotation, position, focal = _disturbed(camera, cameras, count)
    x, y, yaw = scenes.object_pose.astype(np.float64).T
    scale = scenes.scale.astype(np.float64)
    world_to_object = np.zeros((count, 3, 3))
    world_to_object[:, 0, 0] = world_to_object[:, 1, 1] = np.cos(yaw)
    world_to_object[:, 0, 1], world_to_object[:, 1, 0] = np.sin(yaw), -np.sin(yaw)
    world_to_object[:, 2, 2] = 1
    camera_to_object = world_to_object @ rotation / scale[:, None, None]
    position = position - np.stack([x, y, np.zeros(count)], axis=1)
    origin = np.einsum("nij,nj->ni", world_to_object, position) / scale[:, None]
    to_ray = np.zeros((count, 3, 3))
    to_ray[:, 0, 0], to_ray[:, 1, 1] = 1 / focal.T
    to_ray[:, 0, 2], to_ray[:, 1, 2] = -camera.cx / focal[:, 0], -camera.cy / focal[:, 1]
    to_ray[:, 2, 2] = 1
    return Views(
        ray_matrix=camera_to_object @ to_ray,
        origin=origin,
        projector=origin + camera_to_object[:, :, 0] * baseline,
        near=np.zeros(count) if cameras is None else cameras.near.astype(np.float64),
        far=np.full(count, np.inf) if cameras is None else cameras.far.astype(np.float64),
    )


def disturbed_camera(camera: Camera, cameras: CameraNuisances, index: int) -> Camera:
    """The nominal camera as row `index` of its nuisances disturbs it; a camera has no range, so that is left out."""
    rotation, position, focal = _disturbed(camera, cameras[index : index + 1], 1)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation[0], position[0]
    return replace(camera, fx=float(focal[0, 0]), fy=float(focal[0, 1]), camera_to_world=pose)


def _disturbed(
    camera: Camera, cameras: CameraNuisances | None, count: int
) -> tuple[Float64[np.ndarray, "n 3 3"], Float64[np.ndarray, "n 3"], Float64[np.ndarray, "n 2"]]:
    """Rotations camera_to_world, positions (m) and focal lengths (px)."""
    nominal = np.array([camera.fx, camera.fy])
    rotation, position = camera.pose[:3, :3], camera.pose[:3, 3]
    if cameras is None:
        return np.tile(rotation, (count, 1, 1)), np.tile(position, (count, 1)), np.tile(nominal, (count, 1))
    turns = Rotation.from_rotvec(cameras.rotation_vector.astype(np.float64)).as_matrix()
    half_size = np.array([camera.width, camera.height]) / 2
    half_angle = cameras.field_of_view_factor.astype(np.float64)[:, None] * np.arctan(half_size / nominal)
    if not ((half_angle > 0) & (half_angle < np.pi / 2)).all():
        raise InvalidConfigurationError(
            f"field_of_view_factor from {cameras.field_of_view_factor.min()} to {cameras.field_of_view_factor.max()} "
            f"gives fields of view up to {np.rad2deg(2 * half_angle.max()):.1f} degrees; valid: between 0 and 180"
        )
    return rotation @ turns, position + cameras.position_offset, half_size / np.tan(half_angle)
