"""Two parallel jaws on slides, one of which mimics the other: a hand with one motor and no hinge."""

from bayesgrasp.robot.gripper import Coupling, GripperDescription, Joint, Link, Motor, Preshape, Shape
from bayesgrasp.types import GraspType

STROKE = 0.045
"""Of each jaw, metres."""
FORCE = 40.0
"""Of each jaw, newton."""
LEVER = 0.1
"""Metres that a jaw moves for a radian of the motor's tendon."""


def jaws() -> GripperDescription:
    """The hand; open, its jaws are 90 mm apart."""
    palm = Link("palm", None, (Shape("box", (-0.03, 0.0, 0.0), (0.03, 0.06, 0.03)),), mass=0.6)
    left = _jaw("left", -1.0, (1.0, 0.0, 0.0, 0.0))
    right = _jaw("right", 1.0, (0.0, 1.0, 0.0, 0.0))
    # The motor pulls the left jaw; the right one follows, so that both together press with its force.
    motor = Motor("motor", {"slide_left": 1 / LEVER}, 2 * FORCE * LEVER, 8 * FORCE * LEVER, speed=0.8)
    closed = Preshape({"slide_left": 0.0, "slide_right": 0.0}, travel=(STROKE - 0.001) / LEVER)
    return GripperDescription(
        name="jaws",
        links=(palm, left, right),
        motors=(motor,),
        couplings=(Coupling.mimic("slide_left", "slide_right"),),
        holders={},
        preshapes=dict.fromkeys(GraspType, closed),
        closing_depth=0.07,
    )


def _jaw(name: str, side: float, turn: tuple[float, float, float, float]) -> Link:
    pad = Shape("box", (0.05, -0.006, 0.0), (0.05, 0.006, 0.012))
    slide = Joint(f"slide_{name}", (0.0, 1.0, 0.0), (0.0, STROKE), damping=2.0, armature=0.2, kind="slide")
    return Link(f"jaw_{name}", "palm", (pad,), 0.1, (0.0, side * STROKE, 0.0), turn, slide)
