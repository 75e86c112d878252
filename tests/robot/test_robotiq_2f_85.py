"""The 2F-85's properties, one test each: stroke, closing law, force, and fingertips that turn around an object."""

import mujoco
import numpy as np
import pytest
from closing_hand import ClosingHand

from bayesgrasp.robot.robotiq_2f_85 import CLOSED, CRANK_RANGE, GRIP_FORCE, opening, robotiq_2f_85
from bayesgrasp.types import GraspType

JOINTS = ("crank_left", "tip_left", "crank_right", "tip_right")
BOX = mujoco.mjtGeom.mjGEOM_BOX


def closed(hand: ClosingHand, seconds: float) -> np.ndarray:
    """Joint angles after every control period."""
    hand.handle.open(hand.data, GraspType.BASIC)
    path = []
    for _ in range(round(100 * seconds)):
        hand.tick(GraspType.BASIC)
        path.append([hand.joint(name) for name in JOINTS])
    return np.array(path)


def test_the_stroke_is_the_published_one() -> None:
    assert opening(0.0) == pytest.approx(0.085, abs=0.0005)
    assert opening(CRANK_RANGE[1]) == pytest.approx(0.0, abs=0.0005)


def test_it_closes_evenly_with_parallel_pads() -> None:
    hand = ClosingHand(robotiq_2f_85())
    path = closed(hand, 1.5)
    np.testing.assert_allclose(path[:, 0], path[:, 2], atol=0.003)  # one screw drives both
    np.testing.assert_allclose(path[:, [0, 2]], -path[:, [1, 3]], atol=np.radians(1.5))
    assert path[-1, 0] == pytest.approx(CLOSED, abs=0.01)
    pads = [hand.data.geom(f"fingertip_{name}_0").xpos for name in ("left", "right")]
    half = hand.model.geom("fingertip_left_0").size[1]
    assert pads[1][1] - pads[0][1] - 2 * half == pytest.approx(opening(CLOSED), abs=0.001)


@pytest.mark.parametrize("half_width", [0.01, 0.02, 0.03])
def test_the_force_of_a_pad_is_within_the_device_limits(half_width: float) -> None:
    hand = ClosingHand(robotiq_2f_85(), (BOX, (0.01, half_width, 0.03), (0.093, 0.0, 0.0)))
    closed(hand, 2.0)
    for name in ("left", "right"):
        force = hand.force(f"fingertip_{name}_0")
        assert 20.0 <= force <= 235.0
        assert force == pytest.approx(GRIP_FORCE, rel=0.25)  # the lever changes with the opening


def test_fingertips_turn_around_an_object_at_the_palm() -> None:
    rods = [(BOX, (0.004, 0.004, 0.03), (0.022, side * 0.030, 0.0)) for side in (-1, 1)]
    crank, tip, *_ = closed(ClosingHand(robotiq_2f_85(), *rods), 2.0)[-1]
    assert crank < 0.5, "the cranks must be blocked"
    assert crank + tip > 0.3, "the fingertips must turn inwards"


def test_the_mass_is_the_published_one() -> None:
    assert sum(link.mass for link in robotiq_2f_85().links) == pytest.approx(0.9, abs=0.03)
