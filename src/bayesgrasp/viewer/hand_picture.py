"""Pictures of a hand: open, half way and closed, in columns, along its side and from the corner."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from jaxtyping import Float64, UInt8

from bayesgrasp.geometry.camera import Camera, look_at
from bayesgrasp.lift.hand_kinematics import HandKinematics
from bayesgrasp.types import GraspType
from bayesgrasp.viewer.raycast import ColoredMesh, contact_sheet, physics_meshes, render

PERIOD = 0.01
"""Of the control while it closes, seconds."""
DIRECTIONS = (np.array([1.0, 0.1, 0.1]), np.array([0.6, 0.8, 0.25]))
"""From the hand to the cameras, with z against the approach and y along the closing direction."""
HAND_TO_PICTURE = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Its approach is downwards."""


def hand_picture(
    kinematics: HandKinematics, grasp_type: GraspType = GraspType.BASIC, size: int = 320
) -> UInt8[np.ndarray, "h w 3"]:
    """A hand that closes on nothing in a grasp type; ``size`` is one view's edge, pixels."""
    path = kinematics.free_closing(grasp_type, PERIOD)
    scenes = [_meshes(kinematics, angles) for angles in (path[0], path[len(path) // 2], path[-1])]
    cameras = [_camera(scenes[0], direction, size) for direction in DIRECTIONS]
    return contact_sheet([render(scene, camera) for camera in cameras for scene in scenes], columns=len(scenes))


def _meshes(kinematics: HandKinematics, angles: Float64[np.ndarray, "joints"]) -> list[ColoredMesh]:
    data, model = kinematics.data, kinematics.model
    data.qpos[kinematics.hand.qpos] = angles
    mujoco.mj_kinematics(model, data)
    meshes = zip(physics_meshes(model, data), kinematics.hand.is_geom, strict=True)
    return [replace(mesh, vertices=mesh.vertices @ HAND_TO_PICTURE.T) for mesh, mine in meshes if mine]


def _camera(scene: list[ColoredMesh], direction: Float64[np.ndarray, "3"], size: int) -> Camera:
    """At a distance from which the open hand fills most of the picture."""
    vertices = np.concatenate([mesh.vertices for mesh in scene])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    away = 2.2 * float(np.linalg.norm(high - low)) * direction / np.linalg.norm(direction)
    centre, middle = (size - 1) / 2, (low + high) / 2
    pose = look_at(middle + away, middle)
    return Camera(size, size, fx=2.0 * size, fy=2.0 * size, cx=centre, cy=centre, camera_to_world=pose)
