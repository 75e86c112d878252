"""The first baseline: straight down on the middle of what the camera sees, closing across its principal axis.

The object's visible points give their centroid c and, by the principal axis a of their horizontal coordinates, the
direction across it. The hand points straight down above c and closes across a; its fingertips reach half way down the
object, but no lower than just above the table, and the palm stays above the object's top. Long objects get the wide
type, slender ones pinch, others basic. Of the two hands that differ by half a turn the one that the arm reaches is
taken. No learning and no mesh; the usual heuristic for parallel grippers, on this hand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.scenes import Situation
from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.planning.selection import Robot
from bayesgrasp.types import GraspType, Hands


@dataclass(frozen=True)
class TopDownConfig:
    """Sizes of the heuristic, metres.

    Attributes:
        above_table: Least height of the hand's lowest point.
        above_top: Least height of the palm above the object's highest point.
        long: Objects at least this long are held by the wide type.
        slender: Objects at most this wide are held by the pinch type.

    Raises:
        InvalidConfigurationError: A negative size.
    """

    above_table: float = 0.005
    above_top: float = 0.03
    long: float = 0.12
    slender: float = 0.03

    def __post_init__(self) -> None:
        if min(self.above_table, self.above_top, self.long, self.slender) < 0:
            raise InvalidConfigurationError(f"sizes must be >= 0, in metres, got {self}")


def top_down(
    reader: SurfaceReader, robot: Robot, config: TopDownConfig | None = None
) -> Callable[[Situation, np.random.Generator], Hands | None]:
    """The strategy; it declines where nothing stands on the table.

    Args:
        reader: Finds the object in the network's image.
        robot: The hand and the arm.
        config: Sizes.
    """
    sizes = config or TopDownConfig()

    def choose(situation: Situation, rng: np.random.Generator) -> Hands | None:
        points = reader.read(situation.image).item_points.astype(np.float64)
        if len(points) == 0:
            return None
        poses = [_pose(points, turn, robot, sizes) for turn in (0.0, np.pi)]
        pose, grasp_type = next((p for p in poses if robot.arm.plan(*p) is not None), poses[0])
        rotation, position = torch.from_numpy(pose[None, :3, :3]), torch.from_numpy(pose[None, :3, 3])
        return Hands(position.float(), rotation.float(), torch.tensor([int(grasp_type)]))

    return choose


def _pose(
    points: Float64[np.ndarray, "n 3"], turn: float, robot: Robot, sizes: TopDownConfig
) -> tuple[Float64[np.ndarray, "4 4"], GraspType]:
    """hand_to_world and type; ``turn`` about the vertical, radians."""
    middle, flat = points.mean(axis=0), points[:, :2] - points[:, :2].mean(axis=0)
    _, axes = np.linalg.eigh(flat.T @ flat)
    across, along = axes[:, 0], axes[:, 1]
    width, length = np.ptp(flat @ across), np.ptp(flat @ along)
    grasp_type = GraspType.BASIC
    if width <= sizes.slender:
        grasp_type = GraspType.PINCH
    elif length >= sizes.long:
        grasp_type = GraspType.WIDE
    closing = np.array([*across, 0.0]) * np.cos(turn)
    pose = np.eye(4)
    down = np.array([0.0, 0.0, -1.0])
    pose[:3, :3] = np.stack([down, closing, np.cross(down, closing)], axis=1)
    pose[:2, 3] = middle[:2]
    pose[2, 3] = _height(points[:, 2].max(), pose, grasp_type, robot, sizes)
    return pose, grasp_type


def _height(
    top: float, pose: Float64[np.ndarray, "4 4"], grasp_type: GraspType, robot: Robot, sizes: TopDownConfig
) -> float:
    """Of the palm above the table."""
    fingers = -robot.hand.lowest(pose, grasp_type)  # the pose is still at height 0
    return float(max(fingers + sizes.above_table, top / 2 + fingers, top + sizes.above_top))
