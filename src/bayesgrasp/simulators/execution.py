"""Physics of one attempt: approach, close until contact, lift, hold, decide (section 4.1).

The fingers close at the motors' speed; a motor stops when its tension reaches its torque and goes on if the tension
falls again, and its gear holds what it has reached. The success criterion is stated here and nowhere else, see
`LiftConfig`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float64

from bayesgrasp.assets.arm import JOINTS, ArmDescription
from bayesgrasp.assets.arm_model import add_arm, joint_name
from bayesgrasp.assets.gripper import GripperDescription
from bayesgrasp.assets.gripper_model import GripperHandle, add_gripper
from bayesgrasp.assets.object_asset import ObjectAsset
from bayesgrasp.assets.scene import ObjectHandle, PhysicsConfig, add_object, new_spec
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.simulators.planner import Motion
from bayesgrasp.types import GraspType, Outcome

Observer = Callable[[mujoco.MjModel, mujoco.MjData], None]


@dataclass(frozen=True)
class LiftConfig:
    """Timing of the lift test, and its criterion.

    A grasp succeeds if, after the hand has risen and stood still for ``hold_time``, the object's centre of mass has
    risen by at least ``success_rise`` of the hand's own rise, and if from the start of the lift to the end of the hold
    the object never lost touch with the hand for longer than ``release_time``.

    Attributes:
        approach_time: Seconds from the pre-grasp to h.
        closing_limit: Seconds after which the lift begins even if a motor still moves; it goes on moving then.
        lift_time: Seconds of the rise.
        hold_time: Seconds of standing still after it.
        settle_time: Seconds after closing and before the lift.
        success_rise: Share of the hand's rise, in (0, 1].
        release_time: Seconds.
        control_period: Seconds between updates of set-points and checks.
        largest_speed: Metres per second; an object faster than this means that the simulation diverged.
    """

    approach_time: float = 0.3
    closing_limit: float = 1.5
    lift_time: float = 0.5
    hold_time: float = 0.4
    settle_time: float = 0.05
    success_rise: float = 0.8
    release_time: float = 0.05
    control_period: float = 0.01
    largest_speed: float = 20.0

    def __post_init__(self) -> None:
        times = (
            self.approach_time,
            self.closing_limit,
            self.lift_time,
            self.hold_time,
            self.release_time,
            self.control_period,
        )
        if min(times) <= 0 or self.settle_time < 0:
            raise InvalidConfigurationError("times of the lift test must be positive, in seconds")
        if not 0 < self.success_rise <= 1:
            raise InvalidConfigurationError(f"success_rise must be in (0, 1], got {self.success_rise}")


class Rig:
    """Arm, hand, table and one object in one compiled model, and the execution of attempts in it."""

    def __init__(
        self,
        arm: ArmDescription,
        gripper: GripperDescription,
        asset: ObjectAsset,
        config: LiftConfig,
        physics: PhysicsConfig,
    ) -> None:
        self.config = config
        spec = new_spec(physics)
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        add_gripper(spec, add_arm(spec, arm), gripper)
        add_object(spec, asset)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.object = ObjectHandle(self.model)
        self._steps = round(config.control_period / physics.time_step)
        self.hand = GripperHandle(self.model, gripper)
        self._arm_qpos = np.array([self.model.joint(joint_name(j)).qposadr[0] for j in range(JOINTS)])
        self._arm_ctrl = np.array([self.model.actuator(joint_name(j)).id for j in range(JOINTS)])
        self._is_object = self.model.geom_bodyid == self.object.body
        self._is_robot = ~self._is_object & (self.model.geom_bodyid != 0)

    def collides(self, arm_angles: Float64[np.ndarray, "6"]) -> bool:
        """Whether arm or hand overlaps anything at arm angles (radians); the hand and the object stay as they are."""
        data = self.data
        data.qpos[self._arm_qpos] = arm_angles
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_collision(self.model, data)
        if data.ncon == 0:
            return False
        robot = self._is_robot[data.contact.geom].any(axis=1)
        return bool((robot & (data.contact.dist < 0.0)).any())

    def prepare(
        self,
        grasp_type: GraspType,
        object_pose: Float64[np.ndarray, "7"],
        properties: tuple[float, float, float, float],
    ) -> None:
        """Reset the world: hand open, object at a pose, with (scale, mass factor, lateral, spinning friction)."""
        mujoco.mj_resetData(self.model, self.data)
        self.object.set(*properties)
        self.data.qpos[self.object.qpos] = object_pose
        self.hand.open(self.data, grasp_type)

    def execute(self, grasp_type: GraspType, motion: Motion, observe: Observer | None = None) -> Outcome:
        """Run a prepared attempt to its outcome: NO_CONTACT, DROPPED, SUCCESS or DIVERGED.

        Args:
            grasp_type: As prepared.
            motion: Of the arm; the transit is not simulated.
            observe: Called after every control period.
        """
        run = _Run(self, grasp_type, motion, observe)
        try:
            return run.outcome()
        except _DivergedError:
            return Outcome.DIVERGED

    def set_arm(self, angles: Float64[np.ndarray, "6"]) -> None:
        """Put the arm at joint angles (radians), at rest, and command it to stay."""
        self.data.qpos[self._arm_qpos] = angles
        self.command_arm(angles)

    def command_arm(self, angles: Float64[np.ndarray, "6"]) -> None:
        """Set-points of the arm's servos, radians."""
        self.data.ctrl[self._arm_ctrl] = angles

    def step(self) -> None:
        """Advance by one control period, or raise if the state is not finite or the object flies."""
        data = self.data
        mujoco.mj_step(self.model, data, self._steps)
        speed = data.qvel[self.object.qvel][:3]
        if not np.isfinite(data.qpos).all() or not speed @ speed < self.config.largest_speed**2:
            raise _DivergedError

    def touching(self) -> bool:
        """Whether hand and object are in contact."""
        pairs = self.data.contact.geom
        return len(pairs) > 0 and bool(
            (self._is_object[pairs].any(axis=1) & self.hand.is_geom[pairs].any(axis=1)).any()
        )

    def heights(self) -> tuple[float, float]:
        """Heights of the palm and of the object's centre of mass, metres."""
        return float(self.data.xpos[self.hand.palm, 2]), float(self.data.xipos[self.object.body, 2])


class _DivergedError(Exception):
    """The simulation left the region where it means anything."""


class _Run:
    """One attempt in progress."""

    def __init__(self, rig: Rig, grasp_type: GraspType, motion: Motion, observe: Observer | None) -> None:
        self.rig, self.motion, self.observe = rig, motion, observe
        self.grasp_type = grasp_type
        self.closing = self.advancing = self.touched = False
        self.released = 0.0

    def outcome(self) -> Outcome:
        """Run all phases."""
        config = self.rig.config
        self.rig.set_arm(self.motion.approach[0])
        self._follow(self.motion.approach, config.approach_time)
        self._close()
        self._wait(config.settle_time)
        if not self.touched:
            return Outcome.NO_CONTACT
        return Outcome.SUCCESS if self._lift() else Outcome.DROPPED

    def _close(self) -> None:
        """Close until no motor advances; from now on the motors keep their torque."""
        self.closing = self.advancing = True
        for _ in range(round(self.rig.config.closing_limit / self.rig.config.control_period)):
            if self.advancing:
                self._tick()

    def _lift(self) -> bool:
        """Rise and hold; whether the criterion of `LiftConfig` is met. Ends early once the object is lost."""
        rig, config = self.rig, self.rig.config
        hand, item = rig.heights()
        self.released = 0.0
        held = self._follow(self.motion.lift, config.lift_time) and self._wait(config.hold_time)
        hand_after, item_after = rig.heights()
        return held and item_after - item >= config.success_rise * (hand_after - hand)

    def _follow(self, path: Float64[np.ndarray, "waypoints 6"], duration: float) -> bool:
        """Move the arm's set-points smoothly along a path; False as soon as the object is lost after closing."""
        ticks = max(1, round(duration / self.rig.config.control_period))
        for fraction in np.arange(1, ticks + 1) / ticks:
            smooth = fraction * fraction * (3.0 - 2.0 * fraction) * (len(path) - 1)
            index = min(int(smooth), len(path) - 2)
            self.rig.command_arm(path[index] + (smooth - index) * (path[index + 1] - path[index]))
            if not self._tick():
                return False
        return True

    def _wait(self, duration: float) -> bool:
        return all(self._tick() for _ in range(round(duration / self.rig.config.control_period)))

    def _tick(self) -> bool:
        """One control period; False once hand and object were apart for longer than the release time."""
        rig = self.rig
        self.advancing = self.closing and rig.hand.close(rig.data, self.grasp_type, rig.config.control_period)
        rig.step()
        touching = rig.touching()
        self.touched |= touching
        self.released = 0.0 if touching else self.released + rig.config.control_period
        if self.observe is not None:
            self.observe(rig.model, rig.data)
        return not self.touched or self.released <= rig.config.release_time
