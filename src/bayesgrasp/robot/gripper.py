"""A multi-fingered gripper as data: links, joints, motors, couplings and grasp types.

Another hand is another `GripperDescription`; no code depends on a particular one. A motor drives its joints through a
differential: it pulls one fixed tendon whose length is a weighted sum of joint angles, so a blocked joint lets the
others move on while the tension stays common. A coupling is a passive tendon (spring and stops) between joints, for
instance the parallelogram that keeps a fingertip parallel.

Frames: the hand frame of a description is x = approach, y = closing direction, z = x cross y, origin at the palm.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.types import GraspType, HandIdentity

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
MIMIC_PLAY = 1e-3
"""Radians, either way, that a joint which mimics another one is free to move."""


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

    @staticmethod
    def rod(start: tuple[float, float], end: tuple[float, float], radius: float) -> Shape:
        """A capsule between two points of the link's x-y plane, metres."""
        (x0, y0), (x1, y1) = start, end
        angle = math.atan2(y1 - y0, x1 - x0)
        # A quarter turn about y lays the capsule's z axis along x; then a turn about z points it to the end.
        half = math.sqrt(0.5)
        c, s = math.cos(angle / 2), math.sin(angle / 2)
        quaternion = (c * half, -s * half, c * half, s * half)
        centre = (0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.0)
        return Shape("capsule", centre, (radius, 0.5 * math.hypot(x1 - x0, y1 - y0)), quaternion)


@dataclass(frozen=True)
class Joint:
    """A hinge at the origin of its link, or a slide: axis in the link frame, range in radians, damping in N m s/rad.

    A spring pulls the joint to its lower stop with torque ``preload`` there and ``stiffness`` N m/rad above it. Of a
    slide all of this is in metres and newtons, and its weight in a tendon is in radians a metre.
    """

    name: str
    axis: Vector
    range: tuple[float, float]
    damping: float = 0.02
    armature: float = 0.002
    preload: float = 0.0
    stiffness: float = 0.0
    kind: Literal["hinge", "slide"] = "hinge"


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

    @staticmethod
    def mimic(joint: str, other: str, ratio: float = 1.0) -> Coupling:
        """A joint that moves by ``ratio`` times what another one moves."""
        return Coupling(f"{joint}_mimics_{other}", {joint: 1.0, other: -ratio}, (-MIMIC_PLAY, MIMIC_PLAY), 0.0, 0.0)


@dataclass(frozen=True)
class Preshape:
    """Joint angles of a grasp type before closing (radians, by joint name), and the motors' travel when closing."""

    angles: Mapping[str, float]
    travel: float


@dataclass(frozen=True)
class GripperDescription:
    """A hand: everything that the simulators and the planner know about it.

    Attributes:
        name: What users call it; see `identity`.
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
        for problem in chain(self._problems_of_links(), self._problems_of_names(), self._problems_of_closing()):
            raise InvalidConfigurationError(f"gripper {self.name}: {problem}")

    def _problems_of_links(self) -> Iterator[str]:
        if not self.links:
            yield "it has no links; the first one is the palm"
        known: set[str | None] = {None}
        for link in self.links:
            if link.name in known:
                yield f"two links are named {link.name!r}"
            if link.parent not in known:
                yield f"the parent {link.parent!r} of {link.name!r} must be a link before it"
            if not link.mass > 0:
                yield f"every link needs a positive mass, and {link.name!r} has {link.mass} kg"
            if not link.shapes:
                yield f"the link {link.name!r} has no shape"
            known.add(link.name)
            if link.joint is not None:
                yield from _problems_of_joint(link.joint)

    def _problems_of_names(self) -> Iterator[str]:
        joints, driven = set(self.joint_names), set(self.holders)
        if len(joints) < len(self.joint_names):
            yield f"two joints have one name; its joints are {sorted(self.joint_names)}"
        tendons: tuple[Motor | Coupling, ...] = (*self.motors, *self.couplings)
        for tendon in tendons:
            driven |= set(tendon.weights)
        if unknown := driven.union(*(shape.angles for shape in self.preshapes.values())) - joints:
            yield f"no joint named {sorted(unknown)}; its joints are {sorted(joints)}"
        if idle := joints - driven:
            yield f"no motor, coupling or holder moves the joints {sorted(idle)}"

    def _problems_of_closing(self) -> Iterator[str]:
        if not self.motors:
            yield "it has no motor, so it cannot close"
        for motor in self.motors:
            if not motor.weights:
                yield f"the motor {motor.name!r} pulls no joint"
            if not (0 < motor.torque <= motor.holding_torque and motor.speed > 0):
                yield f"the motor {motor.name!r} needs a positive torque, one at least as large to hold, and a speed"
        for coupling in self.couplings:
            if coupling.preload and not coupling.stiffness:
                yield f"the coupling {coupling.name!r} has a preload and no stiffness"
        if missing := set(GraspType) - set(self.preshapes):
            yield f"no pre-shape for {[m.name for m in missing]}"
        for grasp_type, shape in self.preshapes.items():
            if all(self.tendon(motor, self.open_angles(grasp_type)) >= shape.travel for motor in self.motors):
                yield f"it cannot close in the grasp type {grasp_type!r}: no motor has travel left, {shape.travel}"

    @property
    def identity(self) -> HandIdentity:
        """Its name and a hash of all else; data sets and models made with one hand are refused for another."""
        content = json.dumps(_stated(dataclasses.replace(self, name="")), sort_keys=True)
        return HandIdentity(self.name, hashlib.sha256(content.encode()).hexdigest())

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


def _problems_of_joint(joint: Joint) -> Iterator[str]:
    if not math.isclose(math.hypot(*joint.axis), 1.0, abs_tol=1e-6):
        yield f"the axis of {joint.name!r} must be a unit vector, got {joint.axis}"
    if not joint.range[0] < joint.range[1]:
        yield f"the range of {joint.name!r} must go from low to high, got {joint.range}"
    if joint.preload and not joint.stiffness:
        yield f"the joint {joint.name!r} has a preload and no stiffness"


def _stated(value: Any) -> Any:
    """A description as JSON values, without what is at its default: a field that is added later changes no hash."""
    if dataclasses.is_dataclass(value):
        fields = ((one, getattr(value, one.name)) for one in dataclasses.fields(value))
        return {one.name: _stated(item) for one, item in fields if item != one.default}
    if isinstance(value, Mapping):
        return {str(key): _stated(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_stated(item) for item in value]
    # Sines differ in their last bit between machines, and -0.0 is 0.0.
    return f"{value + 0.0:.9g}" if isinstance(value, float | int) else value
