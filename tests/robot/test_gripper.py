"""The gripper's properties, one test each: closing law, differential, force, and a cylinder in the hand."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from closing_hand import PERIOD, ClosingHand

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.robotiq_3f import FINGERTIP_FORCE, JOINT_1_RANGE, free_closing, robotiq_3f
from bayesgrasp.types import UNSTATED_HAND, GraspType


class Hand(ClosingHand):
    """The Robotiq 3-Finger, with obstacles."""

    def __init__(self, *obstacles: tuple[mujoco.mjtGeom, tuple[float, ...], tuple[float, ...]]) -> None:
        super().__init__(robotiq_3f(), *obstacles)

    def close(self, grasp_type: GraspType, seconds: float) -> list[tuple[float, float, float]]:
        """Close, and return the three joint angles of finger b after every control period."""
        self.handle.open(self.data, grasp_type)
        path = []
        for _ in range(round(seconds / PERIOD)):
            self.tick(grasp_type)
            path.append(tuple(self.joint(f"joint_{k}_b") for k in (1, 2, 3)))
        return path


def test_free_closing_follows_the_published_law() -> None:
    law = np.array([free_closing(g) for g in np.linspace(0, 255, 1000)])
    for angles in Hand().close(GraspType.BASIC, 2.2):
        # The finger may be anywhere along the law, but not beside it.
        assert np.abs(law - angles).max(axis=1).min() < np.radians(1.5)


def test_free_closing_ends_fully_flexed() -> None:
    first, second, third = Hand().close(GraspType.BASIC, 3.0)[-1]
    assert (first, second) == pytest.approx((JOINT_1_RANGE[1], np.pi / 2), abs=0.02)
    assert third == pytest.approx(-JOINT_1_RANGE[1], abs=0.02)


def test_fingertip_stays_parallel_until_a_link_is_blocked() -> None:
    for first, second, third in Hand().close(GraspType.BASIC, 1.0):
        assert abs(first + second + third) < np.radians(1.5)


def test_a_blocked_proximal_link_flexes_the_medial_one() -> None:
    # A rod in the way of the proximal links of b and c, close to the palm.
    rod = (mujoco.mjtGeom.mjGEOM_BOX, (0.005, 0.005, 0.08), (0.075, -0.035, 0.0))
    hand = Hand(rod)
    path = hand.close(GraspType.BASIC, 2.0)
    contacts = {hand.model.geom(g).name for pair in hand.data.contact.geom for g in pair}
    assert "proximal_b_0" in contacts
    first, second, _ = path[-1]
    assert first < 0.8, "the proximal link must be blocked far from its stop"
    assert second > 0.5, "the medial link must flex on"
    free = Hand().close(GraspType.BASIC, 0.8)[-1]
    assert free[1] < 0.01, "without the rod the medial link does not flex before the first stop"


@pytest.mark.parametrize("depth", [0.15, 0.16, 0.17, 0.18])
def test_fingertip_force_is_within_the_device_limits(depth: float) -> None:
    # A fixed block between the pads, so far out that only the pads can touch it.
    hand = Hand((mujoco.mjtGeom.mjGEOM_BOX, (0.02, 0.03, 0.06), (depth, 0.0, 0.0)))
    hand.close(GraspType.BASIC, 2.0)
    force, total = np.zeros(6), 0.0
    for index, contact in enumerate(hand.data.contact):
        names = {hand.model.geom(contact.geom1).name, hand.model.geom(contact.geom2).name}
        assert not names & {"medial_b_0", "proximal_b_0"}
        if names == {"distal_b_0", "obstacle_0"}:
            mujoco.mj_contactForce(hand.model, hand.data, index, force)
            total += force[0]
    assert 15.0 <= total <= 60.0
    assert total == pytest.approx(FINGERTIP_FORCE, rel=0.1)


def test_the_hand_encompasses_a_cylinder() -> None:
    hand = Hand((mujoco.mjtGeom.mjGEOM_CYLINDER, (0.035, 0.09), (0.085, 0.0, 0.0)))
    hand.close(GraspType.BASIC, 2.5)
    touching = {hand.model.geom(g).name for pair in hand.data.contact.geom for g in pair}
    for finger in "abc":
        assert {f"medial_{finger}_0", f"distal_{finger}_0", f"proximal_{finger}_0"} & touching, finger
    # All around: every finger's tip has gone past the cylinder's axis.
    assert all(hand.joint(f"joint_2_{f}") > 0.3 for f in "abc")


def test_the_thumb_withstands_two_fingers() -> None:
    """The gears lock: two fingers against the thumb over a free block do not push it open."""
    hand = Hand((mujoco.mjtGeom.mjGEOM_BOX, (0.02, 0.03, 0.06), (0.14, 0.0, 0.0)))
    hand.close(GraspType.PINCH, 2.0)
    assert hand.joint("joint_1_a") > 0.2


@pytest.mark.parametrize(("grasp_type", "angle"), [(0, 0.0), (1, 0.192), (2, -0.1784)])
def test_scissor_angles(grasp_type: int, angle: float) -> None:
    hand = Hand()
    hand.close(GraspType(grasp_type), 0.5)
    assert hand.joint("scissor_b") == pytest.approx(angle, abs=0.01)
    tips = {f: hand.data.body(f"distal_{f}").xpos[2] for f in "bc"}
    assert tips["c"] - tips["b"] == pytest.approx(0.072 + 2 * 0.104 * np.sin(angle), abs=0.01)


def test_there_are_eleven_joints_and_the_mass_is_right() -> None:
    gripper = robotiq_3f()
    assert len(gripper.joint_names) == 11
    assert sum(link.mass for link in gripper.links) == pytest.approx(2.3)


def test_inertias_satisfy_the_triangle_inequality() -> None:
    for inertia in Hand().model.body_inertia[1:]:
        assert inertia.max() <= inertia.sum() - inertia.max() + 1e-12


def test_a_description_that_names_an_unknown_joint_is_refused() -> None:
    gripper = robotiq_3f()
    with pytest.raises(InvalidConfigurationError, match="no joint named"):
        replace(gripper, holders={"elbow": 1.0})


def test_a_description_without_a_grasp_type_is_refused() -> None:
    gripper: GripperDescription = robotiq_3f()
    with pytest.raises(InvalidConfigurationError, match="PINCH"):
        replace(gripper, preshapes={g: gripper.preshapes[g] for g in (GraspType.BASIC, GraspType.WIDE)})


PALM, *OTHERS = robotiq_3f().links
KNUCKLE = OTHERS[0]
MOTOR, *MOTORS = robotiq_3f().motors


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"links": ()}, "it has no links"),
        ({"links": (replace(PALM, mass=0.0), *OTHERS)}, "positive mass, and 'palm' has 0.0 kg"),
        ({"links": (replace(PALM, mass=float("nan")), *OTHERS)}, "positive mass"),
        ({"links": (replace(PALM, shapes=()), *OTHERS)}, "the link 'palm' has no shape"),
        ({"links": (*OTHERS, PALM)}, "the parent 'palm' of 'knuckle_b' must be a link before it"),
        ({"links": (PALM, PALM, *OTHERS)}, "two links are named 'palm'"),
        ({"links": (PALM, replace(KNUCKLE, joint=replace(KNUCKLE.joint, axis=(0.0, 2.0, 0.0))))}, "unit vector"),
        ({"links": (PALM, replace(KNUCKLE, joint=replace(KNUCKLE.joint, range=(1.0, 0.0))))}, "from low to high"),
        ({"links": (PALM, replace(KNUCKLE, joint=replace(KNUCKLE.joint, preload=1.0)))}, "preload and no stiffness"),
        ({"holders": {"scissor_b": 8.0}}, r"no motor, coupling or holder moves the joints \['scissor_c'\]"),
        ({"motors": (replace(MOTOR, weights={"elbow": 1.0}),)}, r"no joint named \['elbow'\]"),
        ({"motors": (replace(MOTOR, torque=0.0), *MOTORS)}, "'motor_b' needs a positive torque"),
        ({"motors": (replace(MOTOR, weights={}), MOTOR, *MOTORS)}, "'motor_b' pulls no joint"),
        ({"preshapes": {}}, "no pre-shape for"),
        ({"preshapes": {g: replace(s, travel=0.0) for g, s in robotiq_3f().preshapes.items()}}, "cannot close"),
    ],
)
def test_a_description_that_is_no_hand_is_refused_with_one_line(change: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidConfigurationError, match=f"gripper robotiq-3f: .*({message})") as refused:
        replace(robotiq_3f(), **change)
    assert "\n" not in str(refused.value)


def test_the_hash_of_a_description_tells_every_change_of_it() -> None:
    hand = robotiq_3f()
    assert hand.identity.sha256 == UNSTATED_HAND == robotiq_3f().identity.sha256
    palm, *others = hand.links
    faster = replace(hand.motors[0], speed=hand.motors[0].speed * 1.0001)
    thinner = replace(palm, shapes=(replace(palm.shapes[0], size=(0.048, 0.0525, 0.057)),))
    spread = {**hand.preshapes, GraspType.WIDE: hand.preshapes[GraspType.PINCH]}
    changed = [
        replace(hand, closing_depth=0.131),
        replace(hand, motors=(faster, *hand.motors[1:])),
        replace(hand, links=(thinner, *others)),
        replace(hand, preshapes=spread),
        replace(hand, unmodelled_contacts=()),
    ]
    assert len({UNSTATED_HAND, *(one.identity.sha256 for one in changed)}) == 1 + len(changed)


def test_rounding_does_not_change_the_hash_of_a_description() -> None:
    hand = robotiq_3f()
    moved = replace(hand.motors[0], torque=np.nextafter(hand.motors[0].torque, 9.0))
    assert replace(hand, motors=(moved, *hand.motors[1:])).identity == hand.identity
