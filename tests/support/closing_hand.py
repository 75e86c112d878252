"""A hand alone, fixed in space, that closes on obstacles."""

import mujoco
import numpy as np

from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.gripper_model import GripperHandle, add_gripper
from bayesgrasp.robot.physics_scene import TABLE_GEOM, new_spec
from bayesgrasp.types import GraspType

PERIOD, STEPS = 0.01, 5


class ClosingHand:
    """The hand, with optional obstacles given as (type, size, position) in the hand frame."""

    def __init__(
        self,
        gripper: GripperDescription,
        *obstacles: tuple[mujoco.mjtGeom, tuple[float, ...], tuple[float, ...]],
    ) -> None:
        spec = new_spec()
        spec.geom(TABLE_GEOM).contype = spec.geom(TABLE_GEOM).conaffinity = 0
        add_gripper(spec, spec.worldbody, gripper)
        for index, (kind, size, position) in enumerate(obstacles):
            spec.worldbody.add_geom(name=f"obstacle_{index}", type=kind, size=[*size, 0, 0][:3], pos=position)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.handle = GripperHandle(self.model, gripper)

    def joint(self, name: str) -> float:
        return float(self.data.joint(name).qpos[0])

    def tick(self, grasp_type: GraspType) -> None:
        """Close for one control period."""
        self.handle.close(self.data, grasp_type, PERIOD)
        mujoco.mj_step(self.model, self.data, STEPS)

    def force(self, geom: str, obstacle: str = "obstacle_0") -> float:
        """Normal force between a shape of the hand and an obstacle, newton."""
        force, total = np.zeros(6), 0.0
        for index, contact in enumerate(self.data.contact):
            if {self.model.geom(contact.geom1).name, self.model.geom(contact.geom2).name} == {geom, obstacle}:
                mujoco.mj_contactForce(self.model, self.data, index, force)
                total += force[0]
        return total
