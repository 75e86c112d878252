"""The arm above an empty table: for planning on real images.

The motion is that of the lift test (`motion`); the object, known only from one side, is left to the caller.
"""

from __future__ import annotations

import threading
from functools import partial

import mujoco
import numpy as np
from jaxtyping import Float64

from bayesgrasp.robot.arm import ArmDescription
from bayesgrasp.robot.arm_model import ArmHandle, add_arm
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.gripper_model import GripperHandle, add_gripper
from bayesgrasp.robot.motion import Motion, MotionConfig, plan_motion
from bayesgrasp.robot.physics_scene import new_spec
from bayesgrasp.types import GraspType


class ArmOverTable:
    """Plans motions of an arm with a gripper above an empty table (one compiled model; several threads may share it).

    Args:
        arm: The arm.
        gripper: The hand at its end.
        config: Geometry of the motion.
    """

    def __init__(self, arm: ArmDescription, gripper: GripperDescription, config: MotionConfig | None = None) -> None:
        self.arm = arm
        self.config = config or MotionConfig()
        spec = new_spec()
        add_gripper(spec, add_arm(spec, arm), gripper)
        model = spec.compile()
        self._model = model
        self._own = threading.local()
        self._handle = ArmHandle(model)
        self._hand = GripperHandle(model, gripper)

    def plan(self, hand_to_world: Float64[np.ndarray, "4 4"], grasp_type: GraspType) -> Motion | None:
        """A motion to h that is free of collision with the table and the arm itself, or None."""
        data = self._state()
        self._hand.open(data, grasp_type)
        return plan_motion(self.arm, hand_to_world, self.config, partial(self._handle.collides, data))

    def _state(self) -> mujoco.MjData:
        """The state of this thread: in one for all, each would move the others' arm."""
        if not hasattr(self._own, "data"):
            self._own.data = mujoco.MjData(self._model)
        return self._own.data
