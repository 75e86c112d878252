"""Hands to try where a model has no opinion yet: from above, at whatever height the fingers reach.

A model practises what it already believes. Small and thin things are held in a window of a few millimetres of height,
by the type of grasp that closes on little; a hand of the prior is there once in thousands of draws, so a model that
starts from such draws never proposes it. These hands are proposed from the image alone and with no model: above the
visible object, fingertips just over the table or anywhere up to its top, any grasp type, across it or turned at will.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float32, Float64
from scipy.spatial.transform import Rotation

from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.types import GraspType, Hands

ASIDE = 0.012
"""Standard deviation of the hand beside the middle of the visible object, each way, metres."""
TILT = 0.15
"""Standard deviation of the approach axis about each horizontal axis, radians."""
TURN = 0.2
"""Standard deviation of the closing axis about the direction across the object, radians; every second hand: any."""
OVER_TABLE = (0.001, 0.02)
"""Height of the lowest point of the open hand above the table where it reaches for the table, metres."""
AT_TABLE = 2 / 3
"""Share of hands that do; the others end anywhere between the table and the object's top."""


class Explorer:
    """Proposes hands above what an image shows.

    Args:
        reader: Finds the object in the network's image.
        hand: The open hand.
        prior: Hands stay in its box and have one of its types.
    """

    def __init__(self, reader: SurfaceReader, hand: OpenHand, prior: GraspPrior) -> None:
        self.reader, self.hand, self.prior = reader, hand, prior

    def propose(self, image: Float32[np.ndarray, "h w"], count: int, rng: np.random.Generator) -> Hands:
        """So many hands for a depth image (metres, 0 = no return), batch shape (count,); the prior's where it is bare.

        The image is read in the world frame, which the hands are in.
        """
        surface = self.reader.read(image) if count else None
        if surface is None or not surface.item.any():
            return self.prior.sample(count, rng)
        points = surface.item_points.astype(np.float64)
        types = rng.choice(self.prior.types, count)
        rotations = _downwards(_across(points[:, :2]), count, rng)
        heights = self._heights(rotations, types, points[:, 2].max(), rng)
        place = surface.center + rng.normal(0.0, ASIDE, (count, 2))
        position = np.clip(np.column_stack([place, heights]), *np.transpose([self.prior.x, self.prior.y, self.prior.z]))
        return Hands(torch.from_numpy(position).float(), torch.from_numpy(rotations).float(), torch.from_numpy(types))

    def _heights(
        self, rotations: Float64[np.ndarray, "n 3 3"], types: np.ndarray, top: float, rng: np.random.Generator
    ) -> Float64[np.ndarray, "n"]:
        """Of the palm above the table, metres."""
        pose = np.eye(4)
        below = np.empty(len(types))
        for row, rotation in enumerate(rotations):
            pose[:3, :3] = rotation
            below[row] = -self.hand.lowest(pose, GraspType(types[row]))
        highest = np.where(rng.random(len(types)) < AT_TABLE, OVER_TABLE[1], max(top, OVER_TABLE[1]))
        heights: Float64[np.ndarray, "n"] = below + rng.uniform(OVER_TABLE[0], highest)
        return heights


def _across(flat: Float64[np.ndarray, "n 2"]) -> float:
    """Angle of the direction in which points spread least, radians."""
    away = flat - flat.mean(axis=0)
    x, y = np.linalg.eigh(away.T @ away)[1][:, 0]
    return float(np.arctan2(y, x))


def _downwards(across: float, count: int, rng: np.random.Generator) -> Float64[np.ndarray, "n 3 3"]:
    """Rotations of hands whose approach axis (x) points down, about, and whose closing axis (y) has some angle."""
    angle = across + np.pi * rng.integers(2, size=count) + rng.normal(0.0, TURN, count)
    angle = np.where(np.arange(count) % 2 == 0, angle, rng.uniform(0.0, 2 * np.pi, count))
    zero = np.zeros(count)
    down, closing = np.array([0.0, 0.0, -1.0]), np.column_stack([np.cos(angle), np.sin(angle), zero])
    upright = np.stack([np.broadcast_to(down, closing.shape), closing, np.cross(down, closing)], axis=2)
    tilt = Rotation.from_rotvec(np.column_stack([*rng.normal(0.0, TILT, (2, count)), zero]))
    rotations: Float64[np.ndarray, "n 3 3"] = tilt.as_matrix() @ upright
    return rotations
