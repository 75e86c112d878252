"""One attempt in float64: which hand comes to which pose, and the object that stands there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesgrasp.robot.motion import Pose
from bayesgrasp.robot.physics_scene import ObjectState, planar_pose
from bayesgrasp.types import Attempts, GraspType


@dataclass(frozen=True)
class Attempt:
    """What a model needs to know to show an attempt.

    Attributes:
        grasp_type: Pre-shape of the hand.
        hand_to_world: h, metres.
        item: The object, and where it stands.
    """

    grasp_type: GraspType
    hand_to_world: Pose
    item: ObjectState

    @staticmethod
    def of(attempts: Attempts, row: int, hand_to_world: Pose) -> Attempt:
        """One row of many, whose hand's pose is known already."""
        item = ObjectState(
            planar_pose(*attempts.object_pose[row].astype(np.float64)),
            float(attempts.scale[row]),
            float(attempts.mass_factor[row]),
            float(attempts.lateral_friction[row]),
            float(attempts.spinning_friction[row]),
        )
        return Attempt(GraspType(attempts.grasp_type[row]), hand_to_world, item)
