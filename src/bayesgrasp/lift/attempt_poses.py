"""Where hand and object of each attempt are, in float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from bayesgrasp.robot.motion import hand_pose
from bayesgrasp.robot.physics_scene import planar_pose
from bayesgrasp.types import Attempts


@dataclass(frozen=True)
class AttemptPoses:
    """Attempts in float64: rotations (n, 3, 3) and poses (n, 4, 4) hand_to_world, and planar object poses (n, 7)."""

    rotation: Float64[np.ndarray, "n 3 3"]
    hand_to_world: Float64[np.ndarray, "n 4 4"]
    object_to_world: Float64[np.ndarray, "n 7"]

    @staticmethod
    def of(attempts: Attempts) -> AttemptPoses:
        """Of all attempts."""
        hands = np.array(
            [
                hand_pose(p.astype(np.float64), q.astype(np.float64))
                for p, q in zip(attempts.position, attempts.quaternion, strict=True)
            ]
        ).reshape(-1, 4, 4)
        objects = np.array([planar_pose(*row.astype(np.float64)) for row in attempts.object_pose]).reshape(-1, 7)
        return AttemptPoses(np.ascontiguousarray(hands[:, :3, :3]), hands, objects)


def properties(attempts: Attempts, row: int) -> tuple[float, float, float, float]:
    """Scale, mass factor, lateral and spinning friction of an attempt, as `ObjectHandle.set` takes them."""
    columns = (attempts.scale, attempts.mass_factor, attempts.lateral_friction, attempts.spinning_friction)
    scale, mass_factor, lateral, spinning = (float(column[row]) for column in columns)
    return scale, mass_factor, lateral, spinning


def hull_in_hand(
    attempts: Attempts, poses: AttemptPoses, rows: np.ndarray, hull: Float64[np.ndarray, "vertices 3"]
) -> Float64[np.ndarray, "rows vertices 3"]:
    """Vertices of the objects' convex hulls in the hand frames, metres."""
    x, y, yaw = attempts.object_pose.astype(np.float64).T
    cos, sin, zero = np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)
    turn = np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, zero + 1.0], axis=-1).reshape(-1, 3, 3)
    world = attempts.scale.astype(np.float64)[:, None, None] * (hull @ turn.transpose(0, 2, 1))
    world += np.stack([x, y, zero], axis=-1)[:, None, :]
    in_hand: Float64[np.ndarray, "rows vertices 3"] = (world - poses.hand_to_world[rows, None, :3, 3]) @ poses.rotation[
        rows
    ]
    return in_hand
