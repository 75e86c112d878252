"""The lift test's physics in PyBullet, the paper's own engine.

The scene is `robot` and `item`, servos and tendons are `servo_forces`; all are
translated from the compiled MuJoCo model, so no number of the scene is stated twice. Every attempt gets a new world, so
its outcome depends on it alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.lift.bullet.client import Client
from bayesgrasp.lift.bullet.item import BulletObject, add_table, hulls_file
from bayesgrasp.lift.bullet.robot import BulletRobot
from bayesgrasp.lift.bullet.servo_forces import ServoForces
from bayesgrasp.robot.gripper_model import GripperHandle
from bayesgrasp.robot.physics_scene import ObjectHandle


@dataclass(frozen=True)
class BulletConfig:
    """Numerics of PyBullet.

    Attributes:
        time_step: Seconds; torques of servos are explicit, so it must be short against the stiffest of them.
        solver_iterations: Of the projected Gauss-Seidel solver, at most, per step.
        contact_recovery: Share of a penetration that is removed in a step (Bullet's contact ERP).
        contact_distance: Metres at which a contact point is forgotten.
    """

    time_step: float = 0.001
    solver_iterations: int = 100
    contact_recovery: float = 0.2
    contact_distance: float = 0.002

    def __post_init__(self) -> None:
        if not 0 < self.time_step <= 0.002:
            raise InvalidConfigurationError(f"PyBullet's time_step must be in (0, 0.002] s, got {self.time_step}")
        if self.solver_iterations < 1 or not 0 < self.contact_recovery <= 1 or self.contact_distance <= 0:
            raise InvalidConfigurationError(
                "PyBullet needs solver_iterations >= 1, contact_recovery in (0, 1] and contact_distance > 0; "
                f"got {self.solver_iterations}, {self.contact_recovery} and {self.contact_distance}"
            )


class BulletEngine:
    """PyBullet behind the shared state.

    Args:
        client: Connection, which may serve any number of engines in turn.
        config: Numerics.
        model: With a hand and an object at scale 1.
        data: Of the model.
        hand: The hand in it.
        item: The object in it.
    """

    def __init__(
        self,
        client: Client,
        config: BulletConfig,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        hand: GripperHandle,
        item: ObjectHandle,
    ) -> None:
        self.client, self.model, self.data, self.config = client, model, data, config
        self._item = item
        self._hulls = hulls_file(model)
        self._hand_bodies = set(np.unique(model.geom_bodyid[hand.is_geom]).tolist())

    def start(self) -> None:
        """Build the world as the shared state has it."""
        client, model, data, config = self.client, self.model, self.data, self.config
        client.resetSimulation()
        client.setPhysicsEngineParameter(
            fixedTimeStep=config.time_step,
            numSolverIterations=config.solver_iterations,
            contactERP=config.contact_recovery,
            frictionERP=config.contact_recovery,
            contactBreakingThreshold=config.contact_distance,
            enableConeFriction=1,
            deterministicOverlappingPairs=1,
        )
        add_table(client, model)
        self.robot = BulletRobot(client, model)
        self.object = BulletObject(client, model, self._hulls, self._item.scale)
        self.object.put(data.qpos[self._item.qpos])
        joints = [int(model.body_jntadr[self.robot.links[k]]) for k in self.robot.joints]
        self._qpos, self._dofs = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        for link, angle in zip(self.robot.joints, data.qpos[self._qpos].tolist(), strict=True):
            client.resetJointState(self.robot.body, link, angle)
        self._forces = ServoForces(model, joints, config.time_step)
        self._hand_links = {k for k, body in enumerate(self.robot.links) if body in self._hand_bodies}

    def advance(self, seconds: float) -> None:
        """Whole steps, with torques computed anew in each; then bring the shared state up to date."""
        client, data, robot, item = self.client, self.data, self.robot, self.object.body
        push = (data.xfrc_applied[self._item.body, :3] + self._weight()).tolist()
        q, speed = self._joint_states()
        for _ in range(round(seconds / self.config.time_step)):
            torque, data.actuator_force[:] = self._forces.act(q, speed, data.ctrl)
            client.setJointMotorControlArray(robot.body, robot.joints, client.TORQUE_CONTROL, forces=torque.tolist())
            center, _ = client.getBasePositionAndOrientation(item)
            client.applyExternalForce(item, -1, push, center, client.WORLD_FRAME)
            client.stepSimulation()
            q, speed = self._joint_states()
        data.time += seconds
        data.qpos[self._qpos], data.qvel[self._dofs] = q, speed
        self._read_object()

    def touching(self) -> bool:
        """Whether a link of the hand presses on the object."""
        contacts = self.client.getContactPoints(self.robot.body, self.object.body)
        return any(contact[3] in self._hand_links and contact[9] > 0.0 for contact in contacts)

    def stop(self) -> None:
        """Empty the world."""
        self.client.resetSimulation()

    def _weight(self) -> np.ndarray:
        """Of the object, newton; the links of the robot carry none."""
        body = self._item.body
        weight: np.ndarray = (
            self.model.body_mass[body] * (1.0 - self.model.body_gravcomp[body]) * self.model.opt.gravity
        )
        return weight

    def _joint_states(self) -> tuple[np.ndarray, np.ndarray]:
        states = self.client.getJointStates(self.robot.body, self.robot.joints)
        q, speed = np.array([state[:2] for state in states]).T
        return q, speed

    def _read_object(self) -> None:
        """Of its velocity only what is needed: the linear one, of the centre of mass."""
        data = self.data
        data.qpos[self._item.qpos] = self.object.pose()
        data.qvel[self._item.qvel][:3] = self.client.getBaseVelocity(self.object.body)[0]
        mujoco.mj_kinematics(self.model, data)
