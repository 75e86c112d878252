"""Is the camera where it is said to be? The table in the image tells, as far as a plane can.

A pose that somebody measured puts the table at z = 0. The table seen in the image has a tilt and a height against
that, three of the pose's six numbers, and both can be corrected: the camera is turned about its own centre, by the
smallest turn that levels the table, and then raised or lowered. What a plane does not show, a turn about the vertical
and a shift along the table, stays as it was stated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64
from scipy.spatial.transform import Rotation

from bayesgrasp.geometry.camera import Camera
from bayesgrasp.observation.table import TableConfig, fit_plane_near, grid


@dataclass(frozen=True)
class TableSeen:
    """The table of an image against the stated pose of its camera.

    Attributes:
        tilt: Angle between the normal of the table and the vertical, radians.
        height: The table lies this much higher than stated, below the camera, metres.
        camera_to_world: The stated pose with tilt and height corrected.
    """

    tilt: float
    height: float
    camera_to_world: Float64[np.ndarray, "4 4"]

    def __str__(self) -> str:
        side = "higher" if self.height > 0 else "lower"
        return f"tilted by {np.degrees(self.tilt):.1f} degrees and {1000 * abs(self.height):.0f} mm {side}"


def see_table(
    depth: Float[np.ndarray, "h w"], camera: Camera, rng: np.random.Generator, config: TableConfig | None = None
) -> TableSeen | None:
    """The table of an image, if it is about where the camera's pose puts it.

    Args:
        depth: Depth image, metres, 0 or NaN = no return.
        camera: Its intrinsics and stated pose.
        rng: For the random planes.
        config: How to find the table.

    Returns:
        None where no plane near the stated table holds enough of the image.
    """
    config = config or TableConfig()
    points = grid(depth, camera, config.stride).reshape(-1, 3)
    stated = camera.pose[2, :3], -camera.pose[2, 3]  # the plane z = 0 in the camera frame
    plane = fit_plane_near(points[np.isfinite(points[:, 2])], stated, rng, config)
    if plane is None:
        return None
    normal, offset = plane
    up = camera.pose[:3, :3] @ normal
    # About the axis in the table's plane: no turn about the vertical.
    axis = np.cross(up, [0.0, 0.0, 1.0])
    tilt = float(np.arctan2(np.linalg.norm(axis), up[2]))
    level = Rotation.from_rotvec(axis * (tilt / max(float(np.linalg.norm(axis)), 1e-12))).as_matrix()
    pose = camera.pose.copy()
    pose[:3, :3] = level @ pose[:3, :3]
    pose[2, 3] = -offset
    return TableSeen(tilt, float(camera.pose[2, 3] + offset), pose)
