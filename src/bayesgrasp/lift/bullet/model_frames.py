"""Poses in a compiled MuJoCo model, as matrices, and rotations in PyBullet's order of quaternions."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float64


def geom_pose(model: mujoco.MjModel, geom: int) -> Float64[np.ndarray, "4 4"]:
    """Pose of a shape in the frame of its body, metres."""
    return pose_matrix(model.geom_pos[geom], model.geom_quat[geom])


def pose_matrix(position: Float64[np.ndarray, "3"], quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "4 4"]:
    """Homogeneous matrix of a position (metres) and a quaternion (w, x, y, z)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation_matrix(quaternion), position
    return pose


def rotation_matrix(quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "3 3"]:
    """Rotation matrix of a quaternion (w, x, y, z)."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def bullet_quaternion(matrix: Float64[np.ndarray, "3 3"]) -> list[float]:
    """Quaternion of a rotation matrix in PyBullet's order (x, y, z, w)."""
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(matrix).ravel())
    return np.roll(quaternion, -1).tolist()
