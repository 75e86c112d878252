"""Boxes to stay out of, a lowest height and grasp types: what a hand may do, and plans that keep to it."""

import itertools
import math

import numpy as np
import pytest
import torch
from box_scene import Box as Thing
from box_scene import box_depth_image

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.box import Box
from bayesgrasp.geometry.camera import canonical_camera, look_at
from bayesgrasp.planning.constraints import ConstraintCheck, Constraints
from bayesgrasp.planning.selection import SelectionConfig
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import GraspType, Hands

HAND = OpenHand(robotiq_3f())
CAMERA = canonical_camera()
STANDOFF = SelectionConfig().standoff
DOWN = torch.tensor([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Points straight down and closes along world y."""


def down_at(x: float, y: float, z: float, kind: GraspType = GraspType.BASIC) -> Hands:
    return Hands(torch.tensor([[x, y, z]]), DOWN[None], torch.tensor([int(kind)]))


def allows(
    constraints: Constraints, hands: Hands, pose: np.ndarray | None = None, standoff: float = STANDOFF
) -> list[bool]:
    check = ConstraintCheck(constraints, HAND, standoff, np.eye(4) if pose is None else pose)
    return check.allows(hands).tolist()


def around(center: np.ndarray, half: float | np.ndarray) -> Box:
    return Box(tuple(np.asarray(center) - half), tuple(np.asarray(center) + half))


def inside_of_shapes(kind: GraspType, rng: np.random.Generator, each: int = 200) -> np.ndarray:
    """Points of the open hand, hand frame: of boxes all of them, of capsules those on the axis."""
    points = []
    for placed in HAND.shapes[kind]:
        extents, _ = placed.rounded_box
        local = rng.uniform(-1, 1, (each, 3)) * extents
        points.append(local @ placed.shape_to_hand[:3, :3].T + placed.shape_to_hand[:3, 3])
    return np.concatenate(points)


def swept_points(hand_to_world: np.ndarray, kind: GraspType, rng: np.random.Generator) -> np.ndarray:
    """Points of the open hand on its straight way to a pose, world frame."""
    points = inside_of_shapes(kind, rng)
    points[:, 0] -= rng.uniform(0, STANDOFF, len(points))
    return points @ hand_to_world[:3, :3].T + hand_to_world[:3, 3]


def in_box(box: Box, points: np.ndarray) -> np.ndarray:
    return ((points > box.low) & (points < box.high)).all(-1)


def test_a_hand_that_would_cut_into_a_box_is_not_allowed() -> None:
    finger = HAND.shapes[GraspType.BASIC][-1].shape_to_hand[:3, 3] @ DOWN.numpy().T.astype(float) + [0.02, -0.01, 0.3]
    hands = Hands.cat([down_at(0.02, -0.01, 0.3), down_at(0.02, 0.39, 0.3)])
    assert allows(Constraints(keep_out=(around(finger, 0.004),)), hands) == [False, True]
    assert allows(Constraints(), hands) == [True, True]


def test_a_thin_wall_between_pre_grasp_and_grasp_is_noticed() -> None:
    """It is nowhere near the hand at either end of the approach; the palm passes through it."""
    palm = HAND.shapes[GraspType.BASIC][0].shape_to_hand[:3, 3]
    top = max(float(-placed.corners()[:, 0].min()) for placed in HAND.shapes[GraspType.BASIC])
    sheet = around(np.array([-0.3, 0.0, 0.3 - float(palm[0]) + top + 0.5 * STANDOFF]), np.array([0.4, 0.4, 0.0005]))
    assert allows(Constraints(keep_out=(sheet,)), down_at(0.0, 0.0, 0.3)) == [False]
    assert allows(Constraints(keep_out=(sheet,)), down_at(0.0, 0.0, 0.3), standoff=0.0) == [True]


@pytest.mark.parametrize("kind", list(GraspType))
def test_whatever_enters_a_box_is_noticed_and_little_else(kind) -> None:
    """Against points of the shapes, with boxes anywhere around tilted hands."""
    rng = generator(0, Stream.ATTEMPT)
    hands = GraspPrior(types=(int(kind),)).sample(300, rng)
    box = Box((-0.06, -0.02, 0.1), (0.05, 0.06, 0.19))
    allowed = np.array(allows(Constraints(keep_out=(box,)), hands))
    pose = np.tile(np.eye(4), (300, 1, 1))
    pose[:, :3, :3], pose[:, :3, 3] = hands.rotation.numpy(), hands.position.numpy()
    clouds = [swept_points(each, kind, rng) for each in pose]
    enters = np.array([in_box(box, cloud).any() for cloud in clouds])
    assert 30 < enters.sum() < 270
    assert not (enters & allowed).any()
    grown = around((np.array(box.low) + box.high) / 2, (np.array(box.high) - box.low) / 2 + 0.03)
    near = np.array([in_box(grown, cloud).any() for cloud in clouds])
    assert allowed[~near].all(), "covering boxes are a few millimetres larger than round shapes, no more"


def test_no_part_of_the_open_hand_is_lower() -> None:
    hands = GraspPrior().sample(200, generator(1, Stream.ATTEMPT))
    found = allows(Constraints(lowest=0.03), hands)
    for row, allowed in enumerate(found):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = hands.rotation[row].double(), hands.position[row].double()
        before = pose.copy()
        before[:3, 3] -= STANDOFF * pose[:3, 0]
        kind = GraspType(int(hands.grasp_type[row]))
        assert allowed == (min(HAND.lowest(pose, kind), HAND.lowest(before, kind)) >= 0.03)
    assert 20 < sum(found) < 180


def test_constraints_are_in_the_world_frame() -> None:
    turned = np.eye(4)
    turned[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    turned[:3, 3] = 0.1, 0.0, 0.0
    box = around(np.array([0.1, 0.2, 0.3]), 0.02)  # where the workspace has (0.2, 0, 0.3)
    hands = Hands.cat([down_at(0.2, 0.0, 0.3), down_at(0.0, 0.2, 0.3)])
    assert allows(Constraints(keep_out=(box,)), hands, turned) == [False, True]


@pytest.fixture(scope="module")
def depth() -> np.ndarray:
    return box_depth_image(CAMERA, (Thing(x=0.02, y=-0.03, yaw=0.4),))


@pytest.mark.parametrize("kinds", [k for n in (1, 2) for k in itertools.combinations(GraspType, n)])
def test_only_allowed_types_are_planned(thumb_planner, depth, kinds) -> None:
    plan = thumb_planner.plan(depth, CAMERA, top=4, constraints=Constraints(grasp_types=kinds))
    assert len(plan.grasps) == 4
    assert {grasp.grasp_type for grasp in plan.grasps} <= set(kinds)


@pytest.mark.parametrize("eye", [(0.40, 0.0, 0.70), (-0.25, 0.35, 0.65)])
def test_plans_stay_out_of_boxes_where_the_best_grasps_were(thumb_planner, eye) -> None:
    camera = CAMERA.with_pose(look_at(np.array(eye), np.array([0.0, 0.0, 0.05])))
    image = box_depth_image(camera, (Thing(x=0.02, y=-0.03, yaw=0.4),))
    free, rng = thumb_planner.plan(image, camera), generator(2, Stream.ATTEMPT)
    palm = free.grasps[0].hand_to_world[:3, 3]
    boxes = (around(palm, 0.03), Box((-0.5, -0.5, 0.0), (0.5, -0.13, 0.6)))
    plan = thumb_planner.plan(image, camera, constraints=Constraints(keep_out=boxes, lowest=0.005))
    assert plan.reason is None
    assert plan.grasps
    for grasp in plan.grasps:
        cloud = swept_points(grasp.hand_to_world, grasp.grasp_type, rng)
        assert not any(in_box(box, cloud).any() for box in boxes)
        assert HAND.lowest(grasp.hand_to_world, grasp.grasp_type) >= 0.005 - 1e-6
    best = [max(grasp.success_probability for grasp in p.grasps) for p in (free, plan)]
    assert best[1] > 0.5 * best[0], "the search goes on beside the box"
    content = plan.to_dict()["constraints"]
    assert content["lowest"] == 0.005
    np.testing.assert_allclose(content["keep_out"][1]["high"], (0.5, -0.13, 0.6))
    assert content["grasp_types"] == ["basic", "wide", "pinch"]
    assert "constraints" not in free.to_dict()


def test_the_posterior_does_not_depend_on_constraints(thumb_planner, depth) -> None:
    free, bound = (
        thumb_planner.plan(depth, CAMERA, constraints=c)
        for c in (Constraints(), Constraints(grasp_types=(GraspType.PINCH,)))
    )
    assert free.posterior.evidence == bound.posterior.evidence


@pytest.mark.parametrize(
    ("constraints", "words"),
    [
        (Constraints(lowest=0.9), "lower than 0.9 m"),
        (Constraints(keep_out=(Box((-1.0, -1.0, -0.1), (1.0, 1.0, 1.0)),)), "in a box to stay out of"),
    ],
)
def test_what_no_hand_can_keep_is_a_reason(thumb_planner, depth, constraints, words) -> None:
    plan = thumb_planner.plan(depth, CAMERA, constraints=constraints, samples=50)
    assert plan.grasps == ()
    assert plan.reason.startswith("no hand keeps the constraints: of 1000 draws from the prior 1000")
    assert words in plan.reason
    assert len(plan.samples.hands.grasp_type) == 50
    assert "reach" not in plan.timings_ms


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"lowest": math.nan}, "lowest"),
        ({"grasp_types": ()}, "GraspType.BASIC"),
        ({"grasp_types": (GraspType.BASIC, GraspType.BASIC)}, "one or more"),
    ],
)
def test_wrong_constraints_are_refused(wrong, words) -> None:
    with pytest.raises(InvalidConfigurationError, match=words):
        Constraints(**wrong)
