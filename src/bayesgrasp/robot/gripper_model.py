"""A gripper in physics: bodies, hinges, tendons and motors added to a MuJoCo specification, and their control.

Each motor becomes a position servo on the tendon of its differential. Closing advances the servo's set-point at the
motor's speed; it stops while the tension is at the motor's torque and goes on when the tension falls, and the servo
withstands up to the gear's holding torque.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import mujoco
import numpy as np
from jaxtyping import Float64

from bayesgrasp.robot.gripper import Coupling, GripperDescription, Joint, Link, Motor
from bayesgrasp.robot.physics_scene import ELASTIC_TIME
from bayesgrasp.types import GraspType

MOTOR_STIFFNESS = 12.0
"""Of the servo of a motor, in its torques a radian: a blocked motor is at its torque 1/12 rad ahead of its finger."""
HOLDER_STIFFNESS = 40.0
"""Of the servo of a held joint, in its largest torques a radian: at its limit it is 1/40 rad, 1.4 degrees, off."""
SLIDE_LEVER = 0.1
"""Metres that a slide moves to count as much as a radian of a hinge, whose links are about as long."""
SERVO_LAG = 0.02
"""Seconds by which a servo follows a moving set-point: damping divided by stiffness."""

_JOINT_TYPES = {"hinge": mujoco.mjtJoint.mjJNT_HINGE, "slide": mujoco.mjtJoint.mjJNT_SLIDE}
_GEOM_TYPES = {"box": mujoco.mjtGeom.mjGEOM_BOX, "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE}


def add_gripper(spec: mujoco.MjSpec, parent: mujoco.MjsBody, gripper: GripperDescription) -> mujoco.MjsBody:
    """Add a gripper below ``parent`` so that the hand frame coincides with the parent's frame.

    Joints, bodies and motors carry the description's names. Links have mass
    but no weight: the arm compensates the hand's, and a finger's own is far below its motor's torque.

    Returns:
        The palm's body.
    """
    bodies: dict[str | None, mujoco.MjsBody] = {None: parent}
    for link in gripper.links:
        bodies[link.name] = _add_link(bodies[link.parent], link)
    for motor in gripper.motors:
        _add_motor(spec, motor)
    for coupling in gripper.couplings:
        _add_coupling(spec, coupling)
    for joint, torque in gripper.holders.items():
        _add_servo(
            spec, f"{joint}_servo", mujoco.mjtTrn.mjTRN_JOINT, joint, gain=HOLDER_STIFFNESS * torque, limit=torque
        )
    _exclude_neighbours(spec, gripper)
    return bodies[gripper.links[0].name]


def _add_link(parent: mujoco.MjsBody, link: Link) -> mujoco.MjsBody:
    body = parent.add_body(name=link.name, pos=link.position, quat=link.quaternion, gravcomp=1.0)
    for index, shape in enumerate(link.shapes):
        body.add_geom(
            name=f"{link.name}_{index}",
            type=_GEOM_TYPES[shape.kind],
            pos=shape.position,
            quat=shape.quaternion,
            size=[*shape.size, 0.0, 0.0][:3],
            mass=link.mass / len(link.shapes),
            rgba=(0.25, 0.25, 0.28, 1.0) if link.joint is None else (0.45, 0.45, 0.5, 1.0),
        )
    if link.joint is not None:
        _add_joint(body, link.joint)
    return body


def _add_joint(body: mujoco.MjsBody, joint: Joint) -> None:
    # A spring k (q - rest) is ``preload`` at the lower stop if it is at rest that far below it.
    rest = joint.range[0] - joint.preload / joint.stiffness if joint.stiffness else 0.0
    body.add_joint(
        name=joint.name,
        type=_JOINT_TYPES[joint.kind],
        axis=joint.axis,
        range=joint.range,
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        damping=(joint.damping, 0.0, 0.0),
        armature=joint.armature,
        stiffness=(joint.stiffness, 0.0, 0.0),
        springref=rest,
        solref_limit=(ELASTIC_TIME, 1.0),
    )


def _add_tendon(spec: mujoco.MjSpec, name: str, weights: Mapping[str, float]) -> mujoco.MjsTendon:
    tendon = spec.add_tendon(name=name)
    for joint, weight in weights.items():
        tendon.wrap_joint(joint, weight)
    return tendon


def _add_motor(spec: mujoco.MjSpec, motor: Motor) -> None:
    _add_tendon(spec, motor.name, motor.weights)
    gain, limit = MOTOR_STIFFNESS * motor.torque, motor.holding_torque
    _add_servo(spec, motor.name, mujoco.mjtTrn.mjTRN_TENDON, motor.name, gain, limit)


def _add_coupling(spec: mujoco.MjSpec, coupling: Coupling) -> None:
    tendon = _add_tendon(spec, coupling.name, coupling.weights)
    tendon.range = coupling.range
    tendon.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    tendon.stiffness[0] = coupling.stiffness
    if coupling.stiffness:
        tendon.springlength = [coupling.range[0] - coupling.preload / coupling.stiffness] * 2
    tendon.solref_limit = (ELASTIC_TIME, 1.0)


def _add_servo(
    spec: mujoco.MjSpec, name: str, transmission: mujoco.mjtTrn, target: str, gain: float, limit: float
) -> None:
    damping = SERVO_LAG * gain
    actuator = spec.add_actuator(name=name, trntype=transmission, target=target)
    actuator.gainprm[0] = gain
    actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    actuator.biasprm[1:3] = -gain, -damping
    actuator.forcerange = (-limit, limit)
    actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE


def _exclude_neighbours(spec: mujoco.MjSpec, gripper: GripperDescription) -> None:
    """Links of one finger, and a finger's first two links and the palm, touch by construction."""
    parents = {link.name: link.parent for link in gripper.links}
    palm = gripper.links[0].name
    pairs = set(gripper.unmodelled_contacts)
    for link in gripper.links:
        ancestor, steps = parents[link.name], 1
        while ancestor is not None:
            if ancestor != palm or steps <= 3:
                pairs.add((ancestor, link.name))
            ancestor, steps = parents[ancestor], steps + 1
    for first, second in sorted(pairs):
        spec.add_exclude(name=f"{first}-{second}", bodyname1=first, bodyname2=second)


@dataclass(frozen=True)
class HandState:
    """A hand in the middle of a motion.

    Attributes:
        angles: Of its joints, radians.
        velocities: Of its joints, rad/s.
        targets: Set-points of its motors, radians of their tendons.
        tensions: Of its motors, N m.
    """

    angles: Float64[np.ndarray, "*ticks joints"]
    velocities: Float64[np.ndarray, "*ticks joints"]
    targets: Float64[np.ndarray, "*ticks motors"]
    tensions: Float64[np.ndarray, "*ticks motors"]

    @staticmethod
    def stack(states: Sequence[HandState]) -> HandState:
        """One after another."""
        return HandState(*(np.stack([getattr(state, one.name) for state in states]) for one in fields(HandState)))

    def __getitem__(self, tick: int) -> HandState:
        return HandState(*(getattr(self, one.name)[tick] for one in fields(HandState)))


class GripperHandle:
    """A gripper inside a compiled model: its addresses, opening and closing."""

    def __init__(self, model: mujoco.MjModel, gripper: GripperDescription) -> None:
        self.gripper = gripper
        self.palm = model.body(gripper.links[0].name).id
        self.qpos = np.array([model.joint(name).qposadr[0] for name in gripper.joint_names])
        self.qvel = np.array([model.joint(name).dofadr[0] for name in gripper.joint_names])
        slides = [link.joint.kind == "slide" for link in gripper.links if link.joint]
        self.levers = np.where(slides, 1.0 / SLIDE_LEVER, 1.0)
        bodies = [model.body(link.name).id for link in gripper.links]
        self.is_geom = np.isin(model.geom_bodyid, bodies)
        self._open = {g: gripper.open_angles(g) for g in GraspType}
        self._slack = {g: np.array([gripper.tendon(m, self._open[g]) for m in gripper.motors]) for g in GraspType}
        self._holders = np.array([model.actuator(f"{name}_servo").id for name in gripper.holders], dtype=np.int64)
        self._held = np.array([gripper.joint_names.index(name) for name in gripper.holders], dtype=np.int64)
        self._motors = np.array([model.actuator(motor.name).id for motor in gripper.motors])
        self._limits = [(motor.torque, motor.speed) for motor in gripper.motors]

    def open(self, data: mujoco.MjData, grasp_type: GraspType) -> None:
        """Put the hand into the pre-shape of a grasp type, at rest."""
        data.qpos[self.qpos] = self._open[grasp_type]
        data.ctrl[self._holders] = self._open[grasp_type][self._held]
        data.ctrl[self._motors] = self._slack[grasp_type]

    def state(self, data: mujoco.MjData) -> HandState:
        """How the hand is and moves."""
        return HandState(
            data.qpos[self.qpos], data.qvel[self.qvel], data.ctrl[self._motors], data.actuator_force[self._motors]
        )

    def move_on(self, data: mujoco.MjData, state: HandState) -> None:
        """Let the hand be and move like that; joints that are held stay so."""
        data.qpos[self.qpos], data.qvel[self.qvel] = state.angles, state.velocities
        data.ctrl[self._motors], data.actuator_force[self._motors] = state.targets, state.tensions

    def close(self, data: mujoco.MjData, grasp_type: GraspType, period: float) -> bool:
        """Advance by ``period`` seconds the motors that have reached neither torque nor travel; whether any moved."""
        travel, any_moved = self.gripper.preshapes[grasp_type].travel, False
        targets, tensions = data.ctrl[self._motors].tolist(), data.actuator_force[self._motors].tolist()
        # Plain numbers: for three motors, several times faster than array calls.
        for motor, (torque, speed) in enumerate(self._limits):
            if tensions[motor] < torque and targets[motor] < travel:
                targets[motor], any_moved = min(targets[motor] + period * speed, travel), True
        if any_moved:
            data.ctrl[self._motors] = targets
        return any_moved
