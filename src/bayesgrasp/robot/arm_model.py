"""The arm in physics: bodies, hinges, capsules and servos added to a MuJoCo specification.

A link's body stands at the end of the link before it and turns about its own z axis, so that the Denavit-Hartenberg
transforms of `bayesgrasp.robot.arm` are the bodies' poses without any further constant. A link's mass is spread evenly
over the volume of its capsules. The controller knows the arm's weight (gravity compensation on its links), as the real
one does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.robot.arm import JOINTS, ArmDescription, Capsule, Six

BASE_RADIUS, BASE_HEIGHT = 0.075, 0.03
"""Of the arm's foot, metres; a pedestal of the same radius reaches down to the table."""

BASE_BODY = "arm_base"
"""Body of the foot and the pedestal; arm and hand hang from it."""

_METAL, _COVER = (0.72, 0.74, 0.76, 1.0), (0.35, 0.60, 0.80, 1.0)


@dataclass(frozen=True)
class ArmServo:
    """Stiff position servos, and the inertia of their rotors seen through the gears.

    Attributes:
        stiffness: kp by joint, N m/rad.
        damping: kv by joint, N m s/rad.
        armature: By joint, kg m^2.
    """

    stiffness: Six = (30000.0, 30000.0, 30000.0, 8000.0, 8000.0, 8000.0)
    damping: Six = (800.0, 800.0, 600.0, 90.0, 90.0, 90.0)
    armature: Six = (2.0, 2.0, 2.0, 0.2, 0.2, 0.2)

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping", "armature"):
            if not all(math.isfinite(value) and value > 0 for value in getattr(self, name)):
                raise InvalidConfigurationError(f"arm servo: {name} needs positive numbers, got {getattr(self, name)}")


def joint_name(joint: int) -> str:
    """Name of a joint (0..5), its actuator and its link's body: ``arm_1`` ... ``arm_6``."""
    return f"arm_{joint + 1}"


def add_arm(spec: mujoco.MjSpec, arm: ArmDescription, servo: ArmServo | None = None) -> mujoco.MjsBody:
    """Add the arm to the world of a specification.

    Bodies, joints and position actuators are named ``arm_1`` ... ``arm_6`` (control = joint angle, radians; force
    limited to the joint's torque). The static base with its pedestal is ``arm_base``. Collision capsules are named
    after their body with an index; neighbouring links do not collide. A servo follows a
    moving command with a lag of damping / stiffness, about 25 ms.

    Args:
        spec: Its angles must be in radians (``spec.compiler.degree = False``).
        arm: What to add.
        servo: Gains of the position actuators.

    Returns:
        The massless body ``arm_hand``, bolted to the flange: its frame is the hand frame, so a hand is added below
        it without any transform.

    Raises:
        InvalidConfigurationError: The specification's angles are in degrees, which is MuJoCo's default.
    """
    if spec.compiler.degree:
        raise InvalidConfigurationError("the arm is described in radians: set spec.compiler.degree = False first")
    servo = servo or ArmServo()
    body = spec.worldbody.add_body(name=BASE_BODY, **_pose(arm.base_to_world))
    pedestal = Capsule((0.0, 0.0, -arm.base_position[2]), (0.0, 0.0, BASE_HEIGHT), BASE_RADIUS)
    _add_capsules(body, BASE_BODY, (pedestal,), _METAL)
    mount = np.eye(4)
    for joint in range(JOINTS):
        body = body.add_body(name=joint_name(joint), gravcomp=1.0, **_pose(mount))
        _add_joint(spec, body, joint, arm, servo)
        _add_capsules(
            body, joint_name(joint), arm.shapes[joint], _COVER if joint in (0, 4) else _METAL, arm.mass[joint]
        )
        mount = arm.fixed_transforms[joint]
    # MuJoCo leaves out contacts between parent and child, but not where the parent is static.
    spec.add_exclude(name=f"{BASE_BODY}-{joint_name(0)}", bodyname1=BASE_BODY, bodyname2=joint_name(0))
    return body.add_body(name="arm_hand", **_pose(mount @ arm.hand_to_flange))


class ArmHandle:
    """The arm inside a compiled model: its addresses, its set-points, and whether it runs into something.

    Args:
        model: With an arm, and with a hand at its end.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self.qpos = np.array([model.joint(joint_name(j)).qposadr[0] for j in range(JOINTS)])
        self._qvel = np.array([model.joint(joint_name(j)).dofadr[0] for j in range(JOINTS)])
        self._ctrl = np.array([model.actuator(joint_name(j)).id for j in range(JOINTS)])
        self._is_robot = model.body_rootid[model.geom_bodyid] == model.body(BASE_BODY).id

    def put(self, data: mujoco.MjData, angles: Float64[np.ndarray, "6"]) -> None:
        """Put the arm at joint angles (radians), at rest, and command it to stay."""
        data.qpos[self.qpos], data.qvel[self._qvel] = angles, 0.0
        self.command(data, angles)

    def command(self, data: mujoco.MjData, angles: Float64[np.ndarray, "6"]) -> None:
        """Set-points of the arm's servos, radians."""
        data.ctrl[self._ctrl] = angles

    def collides(self, data: mujoco.MjData, angles: Float64[np.ndarray, "6"]) -> bool:
        """Whether arm or hand overlaps anything at arm angles (radians); what else is in the scene stays as it is."""
        data.qpos[self.qpos] = angles
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_collision(self.model, data)
        if data.ncon == 0:
            return False
        robot = self._is_robot[data.contact.geom].any(axis=1)
        return bool((robot & (data.contact.dist < 0.0)).any())


def _pose(matrix: Float64[np.ndarray, "4 4"]) -> dict[str, Float64[np.ndarray, "_"]]:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, matrix[:3, :3].ravel())
    return {"pos": matrix[:3, 3], "quat": quaternion}


def _add_joint(spec: mujoco.MjSpec, body: mujoco.MjsBody, joint: int, arm: ArmDescription, servo: ArmServo) -> None:
    limit, torque = arm.limits[joint], arm.torque[joint]
    body.add_joint(
        name=joint_name(joint),
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=(0.0, 0.0, 1.0),
        range=(-limit, limit),
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        armature=servo.armature[joint],
    )
    actuator = spec.add_actuator(
        name=joint_name(joint), trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint_name(joint), ctrlrange=(-limit, limit)
    )
    actuator.set_to_position(kp=servo.stiffness[joint], kv=servo.damping[joint])
    actuator.forcerange = (-torque, torque)
    actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE


def _add_capsules(
    body: mujoco.MjsBody, name: str, capsules: tuple[Capsule, ...], rgba: tuple[float, ...], mass: float = 0.0
) -> None:
    volume = sum(capsule.volume for capsule in capsules)
    for index, capsule in enumerate(capsules):
        body.add_geom(
            name=f"{name}_{index}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=(*capsule.start, *capsule.end),
            size=(capsule.radius, 0.0, 0.0),
            mass=mass * capsule.volume / volume,
            rgba=rgba,
        )
