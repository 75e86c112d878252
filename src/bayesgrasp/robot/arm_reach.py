"""Whether the arm can bring the open hand to a pose, with nothing but the table around: for planning on real images.

The motion is that of the lift test (`planner`); the object, known only from one side, is left to the caller.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float64

from bayesgrasp.robot.arm import JOINTS, ArmDescription
from bayesgrasp.robot.arm_model import add_arm, joint_name
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.gripper_model import GripperHandle, add_gripper
from bayesgrasp.robot.motion import Motion, MotionConfig, plan_motion
from bayesgrasp.robot.physics_scene import new_spec
from bayesgrasp.types import GraspType


class ArmReach:
    """Plans motions of an arm with a gripper above an empty table (one compiled model; not for several threads).

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
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._hand = GripperHandle(self._model, gripper)
        self._arm_qpos = np.array([self._model.joint(joint_name(j)).qposadr[0] for j in range(JOINTS)])

    def __call__(self, hand_to_world: Float64[np.ndarray, "4 4"], grasp_type: GraspType) -> Motion | None:
        """A motion to h that is free of collision with the table and the arm itself, or None."""
        self._hand.open(self._data, grasp_type)
        return plan_motion(self.arm, hand_to_world, self.config, self._collides)

    def _collides(self, arm_angles: Float64[np.ndarray, "6"]) -> bool:
        self._data.qpos[self._arm_qpos] = arm_angles
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        return bool((self._data.contact.dist < 0.0).any())
