"""Screening's certainties, each against a slower way of knowing."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from bayesgrasp.lift.attempt import Attempt
from bayesgrasp.lift.free_closing import MARGIN, FreeClosing
from bayesgrasp.lift.hand_kinematics import CLEARANCE, HandKinematics, shape_points
from bayesgrasp.lift.screening import HandAlone, below_table
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.motion import hand_pose
from bayesgrasp.robot.physics_scene import ObjectState, planar_pose
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import generator
from bayesgrasp.types import GraspType

DOWN = np.array([1.0, 0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def kinematics() -> HandKinematics:
    return HandKinematics(robotiq_3f())


def at(x: float, y: float, z: float) -> Attempt:
    """A hand that points down, and an object in the middle of the table."""
    item = ObjectState(planar_pose(0.0, 0.0, 0.0), 1.0, 1.0, 0.8, 0.004)
    return Attempt(GraspType.BASIC, hand_pose(np.array([x, y, z]), DOWN), item)


def recorded(kinematics: HandKinematics) -> dict[GraspType, FreeClosing]:
    return {g: kinematics.record_closing(g, 0.01, 150, 5) for g in GraspType}


def test_shape_points_cover_their_shape() -> None:
    for link in robotiq_3f().links:
        for shape in link.shapes:
            points, radius = shape_points(shape)
            extent = np.ptp(points, axis=0).max() + 2 * radius
            full = 2 * max(shape.size) if shape.kind == "box" else 2 * (shape.size[0] + shape.size[1])
            assert extent <= full + 1e-9 or shape.kind == "box"
            np.testing.assert_allclose(points.mean(axis=0), shape.position, atol=1e-12)


def test_below_table_is_the_lowest_point(kinematics: HandKinematics) -> None:
    points, radii = kinematics.open_points(GraspType.BASIC)
    down = hand_pose(np.zeros(3), DOWN)[None, :3, :3]
    deepest = float((points[:, 0] + radii).max())  # along the approach axis, which points down
    for gap, expected in ((-1e-6, True), (1e-6, False)):
        position = np.array([[0.0, 0.0, deepest + gap]])
        assert below_table(position, down, points, radii)[0] == expected


def shorter_thumb() -> GripperDescription:
    """The Robotiq 3-Finger without the last link of its thumb: fingers of unequal joints."""
    hand, joint = robotiq_3f(), "joint_3_a"
    *motors, thumb = hand.motors
    thumb = replace(thumb, weights={name: w for name, w in thumb.weights.items() if name != joint})
    shapes = {
        g: replace(s, angles={name: a for name, a in s.angles.items() if name != joint})
        for g, s in hand.preshapes.items()
    }
    links = tuple(link for link in hand.links if link.name != "distal_a")
    couplings = tuple(one for one in hand.couplings if joint not in one.weights)
    return replace(hand, links=links, motors=(*motors, thumb), couplings=couplings, preshapes=shapes)


@pytest.mark.parametrize("grasp_type", list(GraspType))
@pytest.mark.parametrize(
    "kinematics", [HandKinematics(robotiq_3f()), HandKinematics(shorter_thumb())], ids=["3f", "short"]
)
def test_what_can_be_touched_contains_the_hand_at_every_moment(
    kinematics: HandKinematics, grasp_type: GraspType
) -> None:
    regions = kinematics.touchable_regions(grasp_type, 0.1)
    for angles in kinematics.free_closing(grasp_type, 0.01):
        for shapes in kinematics.link_points(angles).values():
            for points, radius in shapes:
                for drawback in (0.0, 0.05, 0.1):
                    moved = points - [drawback, 0.0, 0.0]
                    covered = [(r.normals @ moved.T).max(axis=1) + radius <= r.offsets + 1e-9 for r in regions]
                    assert any(inside.all() for inside in covered)


def test_samples_of_the_closing_motion_are_close_enough(kinematics: HandKinematics) -> None:
    for grasp_type in GraspType:
        clouds = [kinematics._cloud(angles) for angles in kinematics.free_closing(grasp_type, 0.01)]
        moves = [np.linalg.norm(b - a, axis=1).max() for a, b in pairwise(clouds)]
        assert max(moves) <= 2 * (CLEARANCE - MARGIN)


def test_clearance_of_a_hand_above_a_ball(kinematics: HandKinematics) -> None:
    (ball,) = load_objects(["household_ball"])
    hand = HandAlone(robotiq_3f(), ball, recorded(kinematics))
    low, free, around = (at(x, y, z) for x, y, z in ((0.0, 0.0, 0.12), (0.3, 0.3, 0.30), (0.0, 0.0, 0.19)))
    assert hand.approach_clearance(low, 0.1) < 0.0, "fingers of 17 cm reach below the table there"
    assert hand.approach_clearance(free, 0.1) == np.inf
    assert hand.closing_window(free) is None
    assert hand.approach_clearance(around, 0.1) >= 0.0
    assert hand.closing_window(around) is not None


def test_free_closing_is_the_same_every_time(kinematics: HandKinematics) -> None:
    first, second = (kinematics.free_closing(GraspType.PINCH, 0.01) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_a_recorded_closing_is_sampled_often_enough_and_ends_with_its_limit(kinematics: HandKinematics) -> None:
    for grasp_type in GraspType:
        closing = kinematics.record_closing(grasp_type, 0.01, 40, 5)
        assert len(closing) == 1 + 40 + 5
        clouds = [kinematics._cloud(angles) for angles in closing.angles]
        moves = [np.linalg.norm(b - a, axis=1).max() for a, b in pairwise(clouds)]
        assert max(moves) <= 2 * (closing.near - MARGIN) + 1e-12
        np.testing.assert_allclose(np.diff(closing.way), moves, atol=1e-12)


def test_a_window_has_every_tick_near_something(kinematics: HandKinematics) -> None:
    """Clearances that change by no more than the hand moves, looked at in every tick and not only where asked."""
    closing, rng = kinematics.record_closing(GraspType.BASIC, 0.01, 150, 5), generator(5, 0)
    found = []
    for _ in range(200):
        slope = rng.uniform(-1.0, 1.0, len(closing) - 1).cumsum() / 10
        clearance = rng.uniform(0.0, 0.02) + np.cumsum([0.0, *np.clip(slope, -1, 1) * np.diff(closing.way)])
        window = closing.window(lambda tick, known=clearance: float(min(known[tick], CLEARANCE)))
        near = np.flatnonzero(clearance < MARGIN)
        found.append(window is not None)
        if len(near):
            assert window is not None
            assert window.first <= near[0]
            assert near[-1] <= window.last
        if (clearance > closing.near).all():
            assert window is None
    assert {True, False} == set(found)


def test_an_overlap_with_the_object_is_seen(kinematics: HandKinematics) -> None:
    (ball,) = load_objects(["household_ball"])
    hand = HandAlone(robotiq_3f(), ball, recorded(kinematics))
    rng = generator(3, 0)
    points, radii = kinematics.open_points(GraspType.BASIC)
    vertices = ball.vertices
    for x, y in rng.uniform(-0.15, 0.15, (60, 2)):
        attempt = at(x, y, 0.2)
        pose = attempt.hand_to_world
        world = points @ pose[:3, :3].T + pose[:3, 3]
        gaps = np.linalg.norm(world[:, None] - vertices[None], axis=-1).min(axis=1) - radii
        if gaps.min() < -2e-3:  # a vertex of the ball deep inside one of the hand's balls
            assert hand.approach_clearance(attempt, 0.1) < 0.0
