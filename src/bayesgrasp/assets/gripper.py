"""A multi-fingered gripper as data: links, joints, motors, couplings and grasp types.

Another hand is another `GripperDescription`; no code depends on a particular one. A motor drives its joints through a
differential: it pulls one fixed tendon whose length is a weighted sum of joint angles, so a blocked joint lets the
others move on while the tension stays common. A coupling is a passive tendon (spring and stops) between joints, for
instance the parallelogram that keeps a fingertip parallel.

Frames: the hand frame of a description is x = approach, y = closing direction, z = x cross y, origin at the palm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import mujoco
import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.types import GraspType

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)

_GEOM_TYPES = {"box": mujoco.mjtGeom.mjGEOM_BOX, "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE}


@dataclass(frozen=True)
class Shape:
    """One collision shape of a link.

    Attributes:
        kind: "box" (size = half extents) or "capsule" (size = radius, half length; along its z axis).
        position: Centre in the link frame, metres.
        quaternion: Shape frame to link frame, (w, x, y, z).
        size: See kind, metres.
    """

    kind: Literal["box", "capsule"]
    position: Vector
    size: tuple[float, ...]
    quaternion: Quaternion = IDENTITY


@dataclass(frozen=True)
class Joint:
    """A hinge at the origin of its link: axis in the link frame, range in radians, damping in N m s/rad.

    A spring pulls the joint to its lower stop with torque ``preload`` there and ``stiffness`` N m/rad above it.
    """

    name: str
    axis: Vector
    range: tuple[float, float]
    damping: float = 0.02
    armature: float = 0.002
    preload: float = 0.0
    stiffness: float = 0.0


@dataclass(frozen=True)
class Link:
    """A rigid body: pose in its parent (None = the palm's frame itself is the root), joint, shapes and mass (kg)."""

    name: str
    parent: str | None
    shapes: tuple[Shape, ...]
    mass: float
    position: Vector = (0.0, 0.0, 0.0)
    quaternion: Quaternion = IDENTITY
    joint: Joint | None = None


@dataclass(frozen=True)
class Motor:
    """One motor of a finger: pulls the weighted sum of joint angles through a differential.

    Attributes:
        name: Name of the tendon and the actuator.
        weights: d(tendon)/d(joint) by joint name.
        torque: Tension at which the motor stops closing, N m (at a joint of weight 1).
        holding_torque: Tension that its self-locking gear withstands, N m.
        speed: Closing speed of the tendon, rad/s.
    """

    name: str
    weights: Mapping[str, float]
    torque: float
    holding_torque: float
    speed: float


@dataclass(frozen=True)
class Coupling:
    """A passive tendon over joints: stops at ``range`` (radians), spring towards the lower stop as in `Joint`."""

    name: str
    weights: Mapping[str, float]
    range: tuple[float, float]
    preload: float
    stiffness: float


@dataclass(frozen=True)
class Preshape:
    """Joint angles of a grasp type before closing (radians, by joint name), and the motors' travel when closing."""

    angles: Mapping[str, float]
    travel: float


@dataclass(frozen=True)
class GripperDescription:
    """A hand: everything that the simulators and the planner know about it.

    Attributes:
        name: Identity; models trained for one gripper are refused for another.
        links: Parents before children; the first is the palm.
        motors: One per finger.
        couplings: Passive tendons.
        holders: Joints that a stiff servo holds at their pre-shape (spread), with the servo's torque limit, N m.
        preshapes: By grasp type.
        closing_depth: Distance from the palm to the middle of the closing region along the approach axis, metres.
        unmodelled_contacts: Pairs of links that never collide in the real hand but may in the model's shapes.
    """

    name: str
    links: tuple[Link, ...]
    motors: tuple[Motor, ...]
    couplings: tuple[Coupling, ...]
    holders: Mapping[str, float]
    preshapes: Mapping[GraspType, Preshape]
    closing_depth: float
    unmodelled_contacts: tuple[tuple[str, str], ...] = field(default=())

    def __post_init__(self) -> None:
        joints = {link.joint.name for link in self.links if link.joint}
        named = {n for part in (*self.motors, *self.couplings) for n in part.weights} | set(self.holders)
        named |= {n for shape in self.preshapes.values() for n in shape.angles}
        if unknown := named - joints:
            raise InvalidConfigurationError(
                f"gripper {self.name}: no joint named {sorted(unknown)}; its joints are {sorted(joints)}"
            )
        if missing := set(GraspType) - set(self.preshapes):
            raise InvalidConfigurationError(f"gripper {self.name}: no pre-shape for {[m.name for m in missing]}")
        if any(link.mass <= 0 for link in self.links):
            raise InvalidConfigurationError(f"gripper {self.name}: every link needs a positive mass")

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of all joints, in the order of the links."""
        return tuple(link.joint.name for link in self.links if link.joint)

    def open_angles(self, grasp_type: GraspType) -> Float64[np.ndarray, "joints"]:
        """Joint angles (radians) of the open hand in a grasp type's pre-shape."""
        angles = self.preshapes[grasp_type].angles
        lower = {link.joint.name: link.joint.range[0] for link in self.links if link.joint}
        return np.array([angles.get(name, lower[name]) for name in self.joint_names], dtype=np.float64)

    def tendon(self, motor: Motor, angles: Float64[np.ndarray, "joints"]) -> float:
        """Length of a motor's tendon (radians) at the given joint angles."""
        return float(sum(w * angles[self.joint_names.index(n)] for n, w in motor.weights.items()))


def add_gripper(spec: mujoco.MjSpec, parent: mujoco.MjsBody, gripper: GripperDescription) -> mujoco.MjsBody:
    """Add a gripper below ``parent`` so that the hand frame coincides with the parent's frame.

    Collision shapes belong to geom group 3, joints and bodies carry the description's names, each motor becomes a
    position servo on its tendon; whoever closes the hand stops its set-point at ``Motor.torque``. Links gravitate without weight: the
    arm carries the hand, and a finger's own weight is far below its motor's torque.

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
        _add_servo(spec, f"{joint}_servo", mujoco.mjtTrn.mjTRN_JOINT, joint, gain=40.0 * torque, limit=torque)
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
            group=3,
            rgba=(0.25, 0.25, 0.28, 1.0) if link.joint is None else (0.45, 0.45, 0.5, 1.0),
        )
    if link.joint is not None:
        _add_joint(body, link.joint)
    return body


def _add_joint(body: mujoco.MjsBody, joint: Joint) -> None:
    rest = joint.range[0] - joint.preload / joint.stiffness if joint.stiffness else 0.0
    body.add_joint(
        name=joint.name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=joint.axis,
        range=joint.range,
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        damping=(joint.damping, 0.0, 0.0),
        armature=joint.armature,
        stiffness=(joint.stiffness, 0.0, 0.0),
        springref=rest,
        solref_limit=(0.006, 1.0),
    )


def _add_tendon(spec: mujoco.MjSpec, name: str, weights: Mapping[str, float]) -> mujoco.MjsTendon:
    tendon = spec.add_tendon(name=name)
    for joint, weight in weights.items():
        tendon.wrap_joint(joint, weight)
    return tendon


def _add_motor(spec: mujoco.MjSpec, motor: Motor) -> None:
    _add_tendon(spec, motor.name, motor.weights)
    gain, limit = 12.0 * motor.torque, motor.holding_torque
    _add_servo(spec, motor.name, mujoco.mjtTrn.mjTRN_TENDON, motor.name, gain, limit)


def _add_coupling(spec: mujoco.MjSpec, coupling: Coupling) -> None:
    tendon = _add_tendon(spec, coupling.name, coupling.weights)
    tendon.range = coupling.range
    tendon.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    tendon.stiffness[0] = coupling.stiffness
    tendon.springlength = [coupling.range[0] - coupling.preload / coupling.stiffness] * 2
    tendon.solref_limit = (0.006, 1.0)


def _add_servo(
    spec: mujoco.MjSpec, name: str, transmission: mujoco.mjtTrn, target: str, gain: float, limit: float
) -> None:
    damping = 0.02 * gain
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
