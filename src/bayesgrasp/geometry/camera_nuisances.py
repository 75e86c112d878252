"""A camera as its nuisances disturb it (paper, section 4.1).

A disturbed camera stands at t + offset and is turned to R exp(eta); its field of view, an angle, is the nominal one
times a factor, both ways, so that its focal length is (size / 2) / tan(factor * atan(size / 2 / f)).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.types import CameraNuisances


def disturbed_camera(camera: Camera, cameras: CameraNuisances, index: int) -> Camera:
    """The nominal camera as row `index` of its nuisances disturbs it; a camera has no range, so that is left out."""
    rotation, position, focal = disturbed_poses(camera, cameras[index : index + 1], 1)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation[0], position[0]
    return replace(camera, fx=float(focal[0, 0]), fy=float(focal[0, 1]), camera_to_world=pose)


def disturbed_poses(
    camera: Camera, cameras: CameraNuisances | None, count: int
) -> tuple[Float64[np.ndarray, "n 3 3"], Float64[np.ndarray, "n 3"], Float64[np.ndarray, "n 2"]]:
    """Rotations camera_to_world, positions (m) and focal lengths (px) of n disturbed cameras; nominal ones for None.

    Raises:
        InvalidConfigurationError: A field of view is not between 0 and 180 degrees.
    """
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
