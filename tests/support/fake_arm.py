"""An arm that moves as a test says."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayesgrasp.robot.motion import Motion
from bayesgrasp.types import GraspType

STILL = Motion(np.zeros((2, 6)), np.zeros((2, 6)), np.zeros((2, 6)))
"""A motion that stands still."""


@dataclass(frozen=True)
class FakeArm:
    """An arm whose motions are a function of the hand's pose and the grasp type; by default it stands still."""

    plan: Callable[[np.ndarray, GraspType], Motion | None] = lambda hand_to_world, grasp_type: STILL
