"""The Robotiq 2F-85, a two-fingered gripper of 85 mm stroke, as a `GripperDescription`.

Pivots, pads and link masses follow the public model of MuJoCo Menagerie (`robotiq_2f85`, from the maker's CAD), and the
stroke follows from them. Speed and range of force are nominal and not checked against a manual. Hand frame:
x = approach, y = closing direction, z = x cross y, origin between the pivots of the inner bars, 60.9 mm ahead of the
mounting face.

A finger is a parallelogram: an inner and an outer bar carry the fingertip without turning it, along a circle. As in the
real gripper, where a bar is blocked close to the palm, the outer bar folds and the fingertip turns inwards around the
object. Here this is one crank and a fingertip on it, which a passive coupling keeps parallel until the crank is
blocked. One screw drives both fingers, so their cranks mimic one another. With the pad's face 7.5 mm inside of the
crank's end, the open hand is 2 (13.2 + 37 - 7.5) = 85.4 mm wide, and it is closed at 0.80 rad.
"""

from __future__ import annotations

import math

from bayesgrasp.robot.gripper import Coupling, GripperDescription, Joint, Link, Motor, Preshape, Shape
from bayesgrasp.types import GraspType

# Confirmed (public model), metres, kilograms and radians.
PIVOT_OFFSET = 0.0132
CRANK = (0.044, -0.037)
"""From the pivot to the fingertip's joint, open: ahead, and towards the middle."""
CRANK_RANGE = (0.0, 0.8)
FLEXION = 0.87
"""By which a fingertip turns inwards on a blocked crank, at most."""
PAD_BACK, PAD_FRONT, PAD_INNER, PAD_HALF_WIDTH = 0.0070, 0.0445, 0.0075, 0.0110
MOUNTING = 0.0609 + 0.0108
"""Of the flange behind the origin."""
PALM_MASS, CRANK_MASS, TIP_MASS = 0.778, 0.045, 0.016

# Unconfirmed: outlines of what is not the pad, and where in its range of 20 to 235 N the force is set.
PALM_FRONT, PALM_HALF_WIDTHS = 0.018, (0.0375, 0.0310)
BAR_MIDDLE, BAR_RADIUS = (-0.003, -0.0087), 0.009
"""Between inner and outer bar, seen from the pivot of the inner one."""
PAD_OUTER, HEEL = -0.0080, (-0.0065, -0.018)
GRIP_FORCE = 60.0
"""Newton at each pad of a half-closed hand."""

DIFFERENTIAL = (1.0, 0.25)
"""Tension shared by crank and fingertip: contacts 19 mm and more ahead of the fingertip's joint leave it parallel."""
LENGTH = math.hypot(*CRANK)
LEVER = LENGTH * math.cos(math.atan2(-CRANK[1], CRANK[0]) - 0.4)  # metres of pad travel a radian, half closed
# A radian of a crank, the fingertip kept parallel, is w_1 - w_2 of the tendon; see `robotiq_3f`.
MOTOR_TORQUE = GRIP_FORCE * LEVER / (DIFFERENTIAL[0] - DIFFERENTIAL[1])
MOTOR_SPEED = 0.5 * 0.150 / LEVER * (DIFFERENTIAL[0] - DIFFERENTIAL[1])  # the stroke closes with 150 mm/s at most
HOLDING_RATIO = 4.0  # the screw locks itself
CLOSED = 0.79
"""Where the pads have a millimetre between them."""


def opening(angle: float) -> float:
    """Distance between the pads, metres, with the cranks turned by an angle (radians) from where they are open."""
    return 2.0 * (PIVOT_OFFSET - PAD_INNER + LENGTH * math.sin(math.atan2(-CRANK[1], CRANK[0]) - angle))


def robotiq_2f_85() -> GripperDescription:
    """The gripper; it has no spread to set, so its grasp types are the same."""
    fingers = {"left": -1.0, "right": 1.0}
    links = [_palm()]
    for name, side in fingers.items():
        links += _finger(name, side)
    travel = CLOSED * (DIFFERENTIAL[0] - DIFFERENTIAL[1])
    opened = Preshape({f"{joint}_{name}": 0.0 for name in fingers for joint in ("crank", "tip")}, travel)
    return GripperDescription(
        name="robotiq-2f-85",
        links=tuple(links),
        motors=tuple(_motor(name) for name in fingers),
        couplings=(*(_parallelogram(name) for name in fingers), Coupling.mimic("crank_left", "crank_right")),
        holders={},
        preshapes=dict.fromkeys(GraspType, opened),
        closing_depth=CRANK[0] + 0.5 * (PAD_BACK + PAD_FRONT),
    )


def _palm() -> Link:
    half = 0.5 * (MOUNTING + PALM_FRONT)
    body = Shape("box", (PALM_FRONT - half, 0.0, 0.0), (half, *PALM_HALF_WIDTHS))
    return Link("palm", None, (body,), PALM_MASS)


def _finger(name: str, side: float) -> list[Link]:
    """One finger; its frames have x = approach and y = towards the middle when all joints are at zero."""
    inward = (1.0, 0.0, 0.0, 0.0) if side < 0 else (0.0, 1.0, 0.0, 0.0)
    ahead, beside = BAR_MIDDLE
    bar = Shape.rod(BAR_MIDDLE, (CRANK[0] + ahead, CRANK[1] + beside), BAR_RADIUS)
    crank = Joint(f"crank_{name}", (0.0, 0.0, 1.0), CRANK_RANGE, damping=0.05)
    tip = Joint(f"tip_{name}", (0.0, 0.0, 1.0), (-CRANK_RANGE[1], FLEXION))
    heel = Shape.rod((0.0, 0.0), HEEL, -PAD_OUTER)
    position = (0.0, side * PIVOT_OFFSET, 0.0)
    return [
        Link(f"bars_{name}", "palm", (bar,), CRANK_MASS, position, inward, crank),
        Link(f"fingertip_{name}", f"bars_{name}", (_pad(), heel), TIP_MASS, (*CRANK, 0.0), joint=tip),
    ]


def _pad() -> Shape:
    centre = (0.5 * (PAD_BACK + PAD_FRONT), 0.5 * (PAD_INNER + PAD_OUTER), 0.0)
    return Shape("box", centre, (0.5 * (PAD_FRONT - PAD_BACK), 0.5 * (PAD_INNER - PAD_OUTER), PAD_HALF_WIDTH))


def _motor(name: str) -> Motor:
    weights = {f"crank_{name}": DIFFERENTIAL[0], f"tip_{name}": DIFFERENTIAL[1]}
    return Motor(f"motor_{name}", weights, MOTOR_TORQUE, HOLDING_RATIO * MOTOR_TORQUE, MOTOR_SPEED)


def _parallelogram(name: str) -> Coupling:
    """Keep the fingertip parallel: a stop outward, and a spring inward until the crank is blocked."""
    weights = {f"crank_{name}": 1.0, f"tip_{name}": 1.0}
    return Coupling(f"parallel_{name}", weights, (0.0, FLEXION), preload=0.12, stiffness=0.05)
