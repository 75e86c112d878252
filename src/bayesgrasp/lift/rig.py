"""Arm, hand, table and one object in one compiled model, and what a lift test does with them, in any engine."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from jaxtyping import Float64

from bayesgrasp.lift.attempt import Attempt
from bayesgrasp.lift.engine import DivergedError, Engine
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.robot.arm import ArmDescription
from bayesgrasp.robot.arm_model import ArmHandle, add_arm
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.gripper_model import GripperHandle, HandState, add_gripper
from bayesgrasp.robot.physics_scene import ObjectHandle, ObjectState, PhysicsConfig, add_object, new_spec

MakeEngine = Callable[[mujoco.MjModel, mujoco.MjData, GripperHandle, ObjectHandle], Engine]
"""Puts an engine behind a model and its data."""


class Rig:
    """Arm, hand, table and one object, made ready and moved attempt by attempt.

    Args:
        arm: The arm.
        gripper: The hand.
        asset: The object.
        physics: Numerics of the model.
        make_engine: Of the engine that moves it.
    """

    def __init__(
        self,
        arm: ArmDescription,
        gripper: GripperDescription,
        asset: ObjectAsset,
        physics: PhysicsConfig,
        make_engine: MakeEngine,
    ) -> None:
        spec = new_spec(physics)
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        add_gripper(spec, add_arm(spec, arm), gripper)
        add_object(spec, asset)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.object = ObjectHandle(self.model)
        self.arm = ArmHandle(self.model)
        self.hand = GripperHandle(self.model, gripper)
        self.engine = make_engine(self.model, self.data, self.hand, self.object)

    def collides(self, arm_angles: Float64[np.ndarray, "6"]) -> bool:
        """Whether arm or hand overlaps anything at arm angles (radians); the hand and the object stay as they are."""
        return self.arm.collides(self.data, arm_angles)

    def prepare(self, attempt: Attempt) -> None:
        """Reset the world: hand open, object in its place; the arm is nowhere yet."""
        mujoco.mj_resetData(self.model, self.data)
        self.object.put(self.data, attempt.item)
        self.hand.open(self.data, attempt.grasp_type)

    def set_arm(self, angles: Float64[np.ndarray, "6"]) -> None:
        """Put the arm at joint angles (radians), at rest, and command it to stay."""
        self.arm.put(self.data, angles)

    def move_hand_on(self, state: HandState) -> None:
        """Let the hand be and move as a state says."""
        self.hand.move_on(self.data, state)

    def pass_time(self, seconds: float) -> None:
        """Let time go by without physics, and bring positions of bodies up to date."""
        self.data.time += seconds
        mujoco.mj_kinematics(self.model, self.data)

    def command_arm(self, angles: Float64[np.ndarray, "6"]) -> None:
        """Set-points of the arm's servos, radians."""
        self.arm.command(self.data, angles)

    def step(self, seconds: float, largest_speed: float) -> None:
        """Advance, or raise `DivergedError` if the state is not finite or the object faster than that (m/s)."""
        data = self.data
        self.engine.advance(seconds)
        speed = data.qvel[self.object.qvel][:3]
        if not np.isfinite(data.qpos).all() or not speed @ speed < largest_speed**2:
            raise DivergedError

    def heights(self) -> tuple[float, float]:
        """Heights of the palm and of the object's centre of mass, metres."""
        return float(self.data.xpos[self.hand.palm, 2]), float(self.data.xipos[self.object.body, 2])

    def object_shift(self, placed: ObjectState) -> float:
        """How far the object's farthest point is from where it was placed, at most; metres."""
        position, quaternion = np.split(self.data.qpos[self.object.qpos] - placed.pose, [3])
        # A small rotation by an angle changes a unit quaternion by half of it.
        turned = 2.0 * float(np.linalg.norm(quaternion)) * self.object.radius
        return float(np.linalg.norm(position)) + turned

    def object_speed(self) -> float:
        """Of the object's fastest point, at most; metres per second."""
        linear, angular = np.split(self.data.qvel[self.object.qvel], 2)
        return float(np.linalg.norm(linear) + np.linalg.norm(angular) * self.object.radius)

    def hand_shift(self, state: HandState) -> float:
        """Largest difference of a joint of the hand from a state, radians (of a slide, at `SLIDE_LEVER`)."""
        return float((np.abs(self.data.qpos[self.hand.qpos] - state.angles) * self.hand.levers).max())

    def object_in_hand(self) -> Float64[np.ndarray, "4 4"]:
        """Pose of the object's centre of mass, with the axes of its frame, in the hand frame."""
        data, palm, item = self.data, self.hand.palm, self.object.body
        rotation = data.xmat[palm].reshape(3, 3)
        pose = np.eye(4)
        pose[:3, :3] = rotation.T @ data.xmat[item].reshape(3, 3)
        pose[:3, 3] = rotation.T @ (data.xipos[item] - data.xpos[palm])
        return pose

    def push(self, acceleration: Float64[np.ndarray, "3"]) -> None:
        """From now on a force on the object's centre of mass: its mass times an acceleration in the hand frame."""
        model, data, body = self.model, self.data, self.object.body
        data.xfrc_applied[body, :3] = model.body_mass[body] * (data.xmat[self.hand.palm].reshape(3, 3) @ acceleration)
