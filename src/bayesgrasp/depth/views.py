"""Cameras of a batch of scenes, with their nuisances (paper, section 4.1), seen from the objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from bayesgrasp.depth.frame import View
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.geometry.camera_nuisances import disturbed_poses
from bayesgrasp.types import CameraNuisances, Scenes


@dataclass(frozen=True)
class Views:
    """n cameras in the frames of n objects (scale 1); see `frame.View`.

    Attributes:
        ray_matrix: From homogeneous pixels to object-frame rays per metre of depth.
        origin: Cameras.
        second_eye: Projectors, or other cameras of stereo pairs.
        near, far: Range of each camera, metres.
    """

    ray_matrix: Float64[np.ndarray, "n 3 3"]
    origin: Float64[np.ndarray, "n 3"]
    second_eye: Float64[np.ndarray, "n 3"]
    near: Float64[np.ndarray, "n"]
    far: Float64[np.ndarray, "n"]

    def __getitem__(self, index: int) -> View:
        return View(self.ray_matrix[index], self.origin[index], self.second_eye[index])


def object_views(camera: Camera, scenes: Scenes, cameras: CameraNuisances | None, baseline: float) -> Views:
    """The views of scenes.

    Args:
        camera: Nominal camera, with a pose.
        scenes: n scenes.
        cameras: n disturbances; the nominal camera without limits of range if None.
        baseline: From the camera to its second eye along the camera's x axis, metres.
    """
    count = len(scenes)
    rotation, position, focal = disturbed_poses(camera, cameras, count)
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
        second_eye=origin + camera_to_object[:, :, 0] * baseline,
        near=np.zeros(count) if cameras is None else cameras.near.astype(np.float64),
        far=np.full(count, np.inf) if cameras is None else cameras.far.astype(np.float64),
    )
