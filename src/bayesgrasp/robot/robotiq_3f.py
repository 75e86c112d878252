"""The Robotiq 3-Finger gripper as a `GripperDescription`.

Kinematics and joint limits follow the public description of the ROS-Industrial project, grasp types the Gazebo
plugin, the closing law Franchi and Hauser (TR711). Masses are spread over simple shapes so that the inertias
are physical (the public ones violate the triangle inequality). Hand frame: x = approach, y = closing direction; the
fingers B and C stand at -y, the thumb A at +y.

Closing law. A finger has one motor. Free, the first joint turns to its stop at 70 degrees while a parallelogram keeps
the fingertip parallel (third joint = -first); then the second joint flexes to 90 degrees. Blocked, the joint that can
still move takes over, because the motor pulls all three through a differential and weak springs hold the second and
third joint back.
"""

from __future__ import annotations

import math

from bayesgrasp.robot.gripper import Coupling, GripperDescription, Joint, Link, Motor, Preshape, Shape
from bayesgrasp.types import GraspType

# Confirmed kinematics, metres and radians (hand frame).
FINGER_BASE_DEPTH = 0.0214
FINGER_BASE_OFFSET = 0.0455
FINGER_SPREAD = 0.036
KNUCKLE_LENGTH = 0.020
PROXIMAL_VECTOR = (0.050, -0.028)
BEND = 0.52
MEDIAL_LENGTH = 0.039
JOINT_1_RANGE = (0.0495, 1.2218)
JOINT_2_RANGE = (0.0, 1.5708)
JOINT_3_RANGE = (-1.2217, -0.0523)
SCISSOR_RANGE = (-0.1784, 0.192)
FIRST_STOP, CLOSED, PINCH_CLOSED = 140.0, 240.0, 177.0
"""Motor positions (0..255) of a free finger: its first joint stops, it is fully flexed, the pinch grasp ends."""

# Unconfirmed: total mass (kg) and how it is shared; pad thickness from the 155 mm stroke; grip force.
PALM_MASS, KNUCKLE_MASS, PROXIMAL_MASS, MEDIAL_MASS, DISTAL_MASS = 1.55, 0.05, 0.08, 0.07, 0.05
PAD_INNER, PAD_OUTER, PAD_HALF_WIDTH = 0.0154, -0.0080, 0.0110
PAD_BACK, PAD_FRONT = -0.008, 0.046
FINGERTIP_FORCE = 40.0
"""Newton at the pad of a half-closed finger; the device allows 15-60 N."""

# Differential: tension shared by the joints; chosen so that a blocked proximal link makes the medial one flex first.
DIFFERENTIAL = (1.0, 0.6, 0.25)
PARALLEL_LEVER = 0.0963  # metres of pad travel per radian of the first joint, half closed
# Parallel, the third joint turns back by what the first one turns: a radian of the first is w_1 - w_3 of the tendon.
# By virtual work force * lever = tension * (w_1 - w_3), and the tendon's speed is the pad's / lever * (w_1 - w_3).
MOTOR_TORQUE = FINGERTIP_FORCE * PARALLEL_LEVER / (DIFFERENTIAL[0] - DIFFERENTIAL[2])
MOTOR_SPEED = 0.110 / PARALLEL_LEVER * (DIFFERENTIAL[0] - DIFFERENTIAL[2])  # fastest pad speed, 110 mm/s
HOLDING_RATIO = 4.0  # the worm gear withstands this multiple of the closing torque

SCISSOR = {GraspType.BASIC: 0.0, GraspType.WIDE: math.radians(11.0), GraspType.PINCH: -math.radians(11.0)}


def free_closing(position: float) -> tuple[float, float, float]:
    """Joint angles (radians) of an unobstructed finger at motor position g in 0..255 (TR711, jump at 140 removed)."""
    first = min(max(position, 0.0) / FIRST_STOP, 1.0)
    second = min(max((position - FIRST_STOP) / (CLOSED - FIRST_STOP), 0.0), 1.0)
    angle = JOINT_1_RANGE[0] + first * (JOINT_1_RANGE[1] - JOINT_1_RANGE[0])
    return angle, second * JOINT_2_RANGE[1], -angle


def robotiq_3f() -> GripperDescription:
    """The gripper of the paper."""
    fingers = {"b": (-1.0, -FINGER_SPREAD), "c": (-1.0, FINGER_SPREAD), "a": (1.0, 0.0)}
    links = [_palm()]
    for name, (side, spread) in fingers.items():
        links += _finger(name, side, spread)
    return GripperDescription(
        name="robotiq-3f",
        links=tuple(links),
        motors=tuple(_motor(name) for name in fingers),
        couplings=tuple(_parallelogram(name) for name in fingers),
        holders={"scissor_b": 8.0, "scissor_c": 8.0},
        preshapes={g: _preshape(g) for g in GraspType},
        closing_depth=0.13,
        unmodelled_contacts=tuple((f"{p}_b", f"{q}_c") for p in _PARTS for q in _PARTS),
    )


_PARTS = ("knuckle", "proximal", "medial", "distal")


def _palm() -> Link:
    body = Shape("box", (-0.030, 0.0, 0.0), (0.048, 0.0525, 0.058))
    return Link("palm", None, (body,), PALM_MASS)


def _finger(name: str, side: float, spread: float) -> list[Link]:
    """One finger; its frames have x = approach and y = towards the centre when all joints are at zero."""
    inward = (1.0, 0.0, 0.0, 0.0) if side < 0 else (0.0, 1.0, 0.0, 0.0)
    bend = (math.cos(BEND / 2), 0.0, 0.0, -math.sin(BEND / 2))
    unbend = (math.cos(BEND / 2), 0.0, 0.0, math.sin(BEND / 2))
    base = (FINGER_BASE_DEPTH, side * FINGER_BASE_OFFSET, spread)
    knuckle = Shape("box", (0.5 * KNUCKLE_LENGTH, 0.0, 0.0), (0.5 * KNUCKLE_LENGTH, 0.012, 0.012))
    return [
        Link(f"knuckle_{name}", "palm", (knuckle,), KNUCKLE_MASS, base, inward, _scissor(name, spread)),
        Link(
            f"proximal_{name}",
            f"knuckle_{name}",
            (Shape.rod((0.0, 0.0), PROXIMAL_VECTOR, 0.013),),
            PROXIMAL_MASS,
            (KNUCKLE_LENGTH, 0.0, 0.0),
            joint=Joint(f"joint_1_{name}", (0.0, 0.0, 1.0), JOINT_1_RANGE, damping=0.05),
        ),
        Link(
            f"medial_{name}",
            f"proximal_{name}",
            (Shape.rod((0.0, 0.0), (MEDIAL_LENGTH, 0.0), 0.0125),),
            MEDIAL_MASS,
            (*PROXIMAL_VECTOR, 0.0),
            bend,
            Joint(f"joint_2_{name}", (0.0, 0.0, 1.0), JOINT_2_RANGE, preload=0.12, stiffness=0.03),
        ),
        Link(
            f"distal_{name}",
            f"medial_{name}",
            (_pad(),),
            DISTAL_MASS,
            (MEDIAL_LENGTH, 0.0, 0.0),
            unbend,
            Joint(f"joint_3_{name}", (0.0, 0.0, 1.0), JOINT_3_RANGE),
        ),
    ]


def _scissor(name: str, spread: float) -> Joint | None:
    """Only B and C spread; a positive angle moves the fingertip away from the middle."""
    if spread == 0.0:
        return None
    return Joint(f"scissor_{name}", (0.0, -1.0 if spread > 0 else 1.0, 0.0), SCISSOR_RANGE, damping=0.2, armature=0.01)


def _pad() -> Shape:
    centre = (0.5 * (PAD_BACK + PAD_FRONT), 0.5 * (PAD_INNER + PAD_OUTER), 0.0)
    half = (0.5 * (PAD_FRONT - PAD_BACK), 0.5 * (PAD_INNER - PAD_OUTER), PAD_HALF_WIDTH)
    return Shape("box", centre, half)


def _motor(name: str) -> Motor:
    weights = {f"joint_{k}_{name}": w for k, w in enumerate(DIFFERENTIAL, start=1)}
    return Motor(f"motor_{name}", weights, MOTOR_TORQUE, HOLDING_RATIO * MOTOR_TORQUE, MOTOR_SPEED)


def _parallelogram(name: str) -> Coupling:
    """Keep the fingertip parallel: a stop outward, and a spring inward until the links before it are blocked."""
    weights = {f"joint_1_{name}": 1.0, f"joint_3_{name}": 1.0}
    return Coupling(f"parallel_{name}", weights, (0.0, 1.2), preload=0.12, stiffness=0.05)


def _preshape(grasp_type: GraspType) -> Preshape:
    angles = {"scissor_b": SCISSOR[grasp_type], "scissor_c": SCISSOR[grasp_type]}
    angles = {n: min(max(a, SCISSOR_RANGE[0]), SCISSOR_RANGE[1]) for n, a in angles.items()}
    # Open and parallel: joint 1 as far back as its own stop and that of joint 3, which mirrors it, allow.
    opened = max(JOINT_1_RANGE[0], -JOINT_3_RANGE[1])
    angles |= {f"joint_3_{f}": -opened for f in "abc"}
    angles |= {f"joint_1_{f}": opened for f in "abc"}
    closed = free_closing(PINCH_CLOSED if grasp_type is GraspType.PINCH else CLOSED)
    return Preshape(angles, sum(w * angle for w, angle in zip(DIFFERENTIAL, closed, strict=True)))
