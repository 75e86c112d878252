"""What the arm reaches, for the planar refresh (`planar`): the lift test's own inverse kinematics, without physics."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from bayesgrasp.prior.planar_symmetry import Reachable
from bayesgrasp.robot.arm import ArmDescription
from bayesgrasp.robot.motion import MotionConfig, hand_pose, reachable_branches
from bayesgrasp.types import Attempts


def arm_reach(arm: ArmDescription, motion: MotionConfig) -> Reachable:
    """Whether an arm reaches pre-grasp, h and lifted hand on one branch of solutions."""

    def reachable(attempts: Attempts) -> Bool[np.ndarray, "n"]:
        hands = zip(attempts.position.astype(np.float64), attempts.quaternion.astype(np.float64), strict=True)
        return np.array([bool(reachable_branches(arm, hand_pose(x, q), motion)) for x, q in hands], dtype=bool)

    return reachable
