"""Another hand: two rigid fingers, described as data, in the same lift test as the Robotiq 3-Finger.

    python examples/own_hand.py

Both hands come straight down on a box of tea, turned about the vertical in steps, and close. Two fingers must meet its
narrow side. A model that was trained for one hand is refused for another.
"""

import math

import numpy as np

import bayesgrasp as bg
from bayesgrasp.robot.gripper import GripperDescription, Joint, Link, Motor, Preshape, Shape
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.types import Attempts, GraspType, Outcome

FINGER = 0.15
"""Length of a finger, metres."""
FORCE = 30.0
"""At its tip, newton."""


def two_fingers() -> GripperDescription:
    """A hand with a finger on each side of the approach axis; in its frame x = approach, y = closing direction."""
    palm = Link("palm", None, (Shape("box", (-0.03, 0.0, 0.0), (0.03, 0.07, 0.03)),), mass=0.8)
    # The second finger is the first one turned by pi about the approach axis.
    fingers = [_finger("left", -0.06, (1.0, 0.0, 0.0, 0.0)), _finger("right", 0.06, (0.0, 1.0, 0.0, 0.0))]
    motors = [
        Motor(f"motor_{name}", {f"hinge_{name}": 1.0}, FORCE * FINGER, 4 * FORCE * FINGER, speed=0.8)
        for name in ("left", "right")
    ]
    opened = Preshape({"hinge_left": -0.1, "hinge_right": -0.1}, travel=0.5)
    return GripperDescription(
        name="two-fingers",
        links=(palm, *fingers),
        motors=tuple(motors),
        couplings=(),
        holders={},
        preshapes=dict.fromkeys(GraspType, opened),  # it has no spread to set
        closing_depth=0.11,
    )


def _finger(name: str, side: float, turn: tuple[float, float, float, float]) -> Link:
    """A flat finger; a positive angle of its hinge closes it."""
    pad = Shape("box", (FINGER / 2, 0.0, 0.0), (FINGER / 2, 0.008, 0.015))
    hinge = Joint(f"hinge_{name}", (0.0, 0.0, 1.0), (-0.2, 0.6))
    return Link(f"finger_{name}", "palm", (pad,), 0.15, (0.0, side, 0.0), turn, hinge)


def from_above(turns: int, height: float) -> Attempts:
    """Hands over the middle of the first object, their approach axis down, turned about it in equal steps over pi."""
    half = np.linspace(0.0, math.pi, turns, endpoint=False) / 2
    # A quarter turn about y points x downwards; before it, a turn about x is a turn about the approach axis.
    quaternion = np.stack([np.cos(half), np.sin(half), np.cos(half), -np.sin(half)], axis=1) * math.sqrt(0.5)
    one = np.ones(turns, np.float32)
    return Attempts(
        position=np.tile(np.array([0.0, 0.0, height], np.float32), (turns, 1)),
        quaternion=quaternion.astype(np.float32),
        grasp_type=np.full(turns, GraspType.BASIC, np.uint8),
        object_index=np.zeros(turns, np.int32),
        scale=one,
        object_pose=np.zeros((turns, 3), np.float32),
        lateral_friction=0.8 * one,
        spinning_friction=0.004 * one,
        mass_factor=one,
    )


def main(turns: int = 12) -> dict[str, list[float]]:
    """Try both hands on a box of tea.

    Args:
        turns: How many turns to try, in equal steps over pi.

    Returns:
        By hand, the turns (degrees) at which it lifts the box.
    """
    objects = bg.load_objects(["household_tea_box"])
    angles = np.linspace(0.0, 180.0, turns, endpoint=False)
    lifted = {}
    for gripper in (two_fingers(), robotiq_3f()):
        outcomes = bg.LiftTest(objects, gripper=gripper).run(from_above(turns, height=gripper.closing_depth + 0.06))
        lifted[gripper.name] = angles[outcomes == Outcome.SUCCESS].tolist()
        print(f"{gripper.name} lifts the box when turned by {lifted[gripper.name]} degrees, of {angles.tolist()}")
    return lifted


if __name__ == "__main__":
    main()
