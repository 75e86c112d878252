"""From a depth image to ranked grasps, with a rule of thumb in place of a trained ratio."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from box_scene import Box, box_depth_image
from fake_arm import FakeArm
from scipy.spatial.transform import Rotation

from bayesgrasp.errors import BayesgraspError, DepthImageError, InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera, canonical_camera, look_at
from bayesgrasp.observation.familiarity import STATISTICS, Familiarity
from bayesgrasp.observation.user_camera import aligned_workspace, check_scale, to_camera
from bayesgrasp.planning.figure import save_plan_figure
from bayesgrasp.planning.planner import PlannerConfig, TrainedLikelihood
from bayesgrasp.planning.search import SearchConfig
from bayesgrasp.planning.selection import Candidates, Robot, SelectionConfig
from bayesgrasp.posterior.sampling import SamplerConfig
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.seeding import generator
from bayesgrasp.types import GraspType, Hands

CAMERA = canonical_camera()


@pytest.fixture(scope="module")
def depth() -> np.ndarray:
    return box_depth_image(CAMERA, (Box(x=0.02, y=-0.03, yaw=0.4),))


@pytest.fixture(scope="module")
def plan(thumb_planner, depth):
    planner = replace(thumb_planner, config=PlannerConfig(sampler=SamplerConfig(num_draws=2000, chains=100)))
    return planner.plan(depth, CAMERA, top=4, samples=300)


def test_grasps_are_ranked_distinct_and_on_the_object(plan) -> None:
    assert plan.reason is None
    assert 1 <= len(plan.grasps) <= 4
    for grasp in plan.grasps:
        tip = grasp.hand_to_world @ [0.13, 0.0, 0.0, 1.0]
        np.testing.assert_allclose(tip[:2], (0.02, -0.03), atol=0.04)
        assert grasp.on_object > 0.5
        assert grasp.clearance > -0.02
        assert 0 <= grasp.success_probability <= 1


def candidates(posterior: list[float], probability: list[float]) -> Candidates:
    hands = GraspPrior().sample(len(posterior), generator(0))
    return Candidates(hands, torch.tensor(posterior), torch.tensor(probability))


def test_the_likelier_success_goes_first_and_the_posterior_breaks_ties() -> None:
    some = candidates([1.0, 5.0, 3.0, 9.0, 8.0], [0.9, 0.5, 0.89, 0.49, 0.2])
    assert some.ranked(SelectionConfig(tie=0.02)) == [2, 0, 3, 1, 4]
    assert some.ranked(SelectionConfig(tie=0.0)) == [0, 2, 1, 3, 4]
    assert some.ranked(SelectionConfig(rank="posterior")) == [3, 4, 1, 2, 0]


def test_a_broad_maximum_goes_before_a_narrow_one() -> None:
    some = replace(candidates([1.0, 2.0, 3.0], [0.9, 0.95, 0.5]), steady=torch.tensor([0.8, 0.3, 0.4]))
    assert some.ranked(SelectionConfig(tie=0.0)) == [0, 2, 1]
    assert some.ranked(SelectionConfig(rank="posterior")) == [2, 1, 0]


@pytest.mark.parametrize("rank", ["success", "posterior"])
def test_what_is_not_a_number_comes_last(rank) -> None:
    nan = float("nan")
    some = candidates([nan, 5.0, 3.0, nan], [0.9, 0.5, 0.6, nan])
    expected = [0, 2, 1, 3] if rank == "success" else [1, 2, 0, 3]
    assert some.ranked(SelectionConfig(rank=rank, tie=0.0))[:3] == expected[:3]
    nothing = candidates([nan, nan], [nan, nan])
    assert sorted(nothing.ranked(SelectionConfig(rank=rank))) == [0, 1]
    assert candidates([1.0, 2.0], [nan, nan]).ranked(SelectionConfig(rank=rank)) == [1, 0]


def test_ties_are_counted_from_the_best_not_from_neighbour_to_neighbour() -> None:
    chain = candidates([1.0, 2.0, 3.0, 4.0], [0.9, 0.85, 0.8, 0.75])
    assert chain.ranked(SelectionConfig(tie=0.06)) == [1, 0, 3, 2]


def test_likelihood_and_posterior_are_both_searched(thumb_planner, depth) -> None:
    """A ratio that likes tilted hands, where the prior is thin."""

    def given_image(image: torch.Tensor):
        upright = thumb_planner.likelihood.given_image(image)
        return lambda hands: upright(hands) - 4 * (hands.rotation[..., 2, 0] + 0.6).square()

    planner = replace(thumb_planner, likelihood=TrainedLikelihood(given_image, lambda value: value.sigmoid()))
    configs = [PlannerConfig(selection=SelectionConfig(rank=rank, tie=0.0)) for rank in ("success", "posterior")]
    by_success, by_posterior = (replace(planner, config=c).plan(depth, CAMERA, top=1).grasps[0] for c in configs)
    assert by_success.success_probability > by_posterior.success_probability
    assert by_posterior.log_posterior > by_success.log_posterior
    assert by_success.hand_to_world[2, 0] > by_posterior.hand_to_world[2, 0]


def test_hand_in_the_camera_frame_is_the_same_hand(plan) -> None:
    for grasp in plan.grasps:
        np.testing.assert_allclose(CAMERA.pose @ grasp.hand_to_camera, grasp.hand_to_world, atol=1e-9)


def test_plain_data_is_json_with_the_promised_keys(plan) -> None:
    content = json.loads(json.dumps(plan.to_dict()))
    assert {"grasps", "reason", "timings_ms", "observed"} <= content.keys()
    assert {"view", "scene", "encode", "search", "reach", "samples", "total"} == content["timings_ms"].keys()
    for grasp in content["grasps"]:
        pose = grasp["hand_to_world"]
        rotation = np.array(pose["rotation"])
        turned = Rotation.from_quat(pose["quaternion"], scalar_first=True).as_matrix()
        np.testing.assert_allclose(turned, rotation, atol=1e-6)
        assert len(pose["position"]) == 3
        assert grasp["grasp_type"] in {"basic", "wide", "pinch"}
        assert list(grasp["motion"]) == ["transit", "approach", "lift"]
    assert content["samples"]["hands"] == 300


def test_an_unknown_success_probability_is_no_number_in_json(thumb_planner, depth) -> None:
    likelihood = replace(thumb_planner.likelihood, success_probability=lambda value: value * torch.nan)
    plan = replace(thumb_planner, likelihood=likelihood).plan(depth, CAMERA, top=3)
    scores = [grasp.log_posterior for grasp in plan.grasps]
    assert len(scores) == 3
    assert scores == sorted(scores, reverse=True), "where all are alike, the posterior decides"
    content = json.loads(json.dumps(plan.to_dict(), allow_nan=False))
    assert [grasp["success_probability"] for grasp in content["grasps"]] == [None] * 3
    assert plan.grasps[0].chance == "success probability unknown"


def test_same_seed_same_plan(thumb_planner, depth) -> None:
    first, second, other = (thumb_planner.plan(depth, CAMERA, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.grasps[0].hand_to_world, second.grasps[0].hand_to_world)
    assert not np.array_equal(first.grasps[0].hand_to_world, other.grasps[0].hand_to_world)


@pytest.mark.parametrize(
    ("box", "words"),
    [(None, "nothing on the table"), ({"y": 0.25}, "outside the workspace")],
)
def test_no_grasps_come_with_the_reason(thumb_planner, box, words) -> None:
    boxes = () if box is None else (Box(**box),)
    plan = thumb_planner.plan(box_depth_image(CAMERA, boxes), CAMERA)
    assert plan.grasps == ()
    assert words in plan.reason
    assert plan.to_dict()["grasps"] == []
    assert "search" not in plan.timings_ms


def test_an_arm_that_reaches_nothing_is_a_reason(thumb_planner, depth) -> None:
    planner = replace(thumb_planner, robot=Robot(thumb_planner.robot.hand, FakeArm(lambda pose, kind: None)))
    reason = planner.plan(depth, CAMERA).reason
    assert reason.startswith("unreachable")
    assert "the arm does not reach it" in reason


def test_unreachable_grasps_give_way_to_reachable_ones(thumb_planner, depth) -> None:
    def only_pinch(pose: np.ndarray, kind: GraspType):
        return thumb_planner.robot.arm.plan(pose, kind) if kind == GraspType.PINCH else None

    plan = replace(thumb_planner, robot=Robot(thumb_planner.robot.hand, FakeArm(only_pinch))).plan(depth, CAMERA)
    assert plan.grasps
    assert {grasp.grasp_type for grasp in plan.grasps} == {GraspType.PINCH}


def test_hands_that_cut_into_the_surface_are_left_out(thumb_planner) -> None:
    """A post stands where the palm would be: nothing about the ratio knows of it."""
    wall = box_depth_image(CAMERA, (Box(size=(0.05, 0.12, 0.12)), Box(x=-0.055, size=(0.03, 0.3, 0.4))))
    free = replace(thumb_planner, config=PlannerConfig(selection=SelectionConfig(penetration=10.0)))
    careful = thumb_planner.plan(wall, CAMERA)
    assert free.plan(wall, CAMERA).grasps
    assert all(grasp.clearance > -0.03 for grasp in careful.grasps)
    if not careful.grasps:
        assert "cut into" in careful.reason


def test_unlike_images_are_flagged(thumb_planner, depth) -> None:
    k = len(STATISTICS)
    strange = Familiarity(np.full(k, 5.0), np.eye(k), 0.1)
    plan = replace(thumb_planner, observer=replace(thumb_planner.observer, familiarity=strange)).plan(depth, CAMERA)
    assert not plan.observed.familiar
    assert plan.observed.unfamiliarity > 1
    assert any("unlike the training images" in warning for warning in plan.warnings)
    assert not plan.to_dict()["observed"]["familiar"]


def test_without_a_pose_the_grasp_is_given_in_the_camera_frame(thumb_planner) -> None:
    pose = look_at(np.array([0.45, 0.02, 0.70]), np.array([0.05, 0.02, 0.05]))
    camera = replace(CAMERA, camera_to_world=pose)
    depth = box_depth_image(camera, (Box(x=0.05, y=0.02),))
    plan = thumb_planner.plan(depth, camera.with_pose(None))
    assert any("camera_to_world was not given" in warning for warning in plan.warnings)
    tip = pose @ plan.grasps[0].hand_to_camera @ [0.13, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(tip[:2], (0.05, 0.02), atol=0.05)


def test_a_camera_on_another_side_turns_the_workspace() -> None:
    behind = look_at(np.array([-0.5, 0.0, 0.6]), np.zeros(3))
    turned = aligned_workspace(behind, 0.35)
    seen = np.linalg.inv(turned) @ behind
    assert seen[0, 3] == pytest.approx(0.5, abs=1e-6)
    np.testing.assert_array_equal(aligned_workspace(CAMERA.pose, 0.35), np.eye(4))


def test_figure_is_drawn_with_and_without_grasps(thumb_planner, plan, depth, tmp_path) -> None:
    save_plan_figure(tmp_path / "plan.png", plan, depth, CAMERA, thumb_planner.robot.hand)
    empty = box_depth_image(CAMERA)
    nothing = thumb_planner.plan(empty, CAMERA)
    save_plan_figure(tmp_path / "nothing.png", nothing, empty, CAMERA, thumb_planner.robot.hand)
    assert (tmp_path / "plan.png").stat().st_size > 20_000
    assert (tmp_path / "nothing.png").exists()


def test_absurd_depths_are_no_returns(thumb_planner, depth) -> None:
    camera = CAMERA.with_pose(None)
    absurd = np.where(generator(2).random(depth.shape) < 0.01, np.float32(1e30), depth)
    plan, expected = (thumb_planner.plan(d, camera) for d in (absurd, np.where(absurd > 20, np.float32(0), depth)))
    assert plan.grasps
    np.testing.assert_array_equal(plan.grasps[0].hand_to_world, expected.grasps[0].hand_to_world)


def wrong(depth: np.ndarray, kind: str) -> np.ndarray:
    bad = depth.copy()
    if kind == "nan":
        bad[3, 4] = np.nan
    if kind == "negative":
        bad[3, 4] = -1.0
    return {
        "shape": depth[None],
        "size": depth[:-1],
        "millimetres": (1000 * depth).astype(np.uint16),
        "float millimetres": 1000 * depth,
        "centimetres as millimetres": 0.1 * depth,
        "quarters of millimetres": 4 * depth,
        "zero": np.zeros_like(depth),
    }.get(kind, bad)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("shape", "shape"),
        ("size", "479 pixels"),
        ("nan", "NaN"),
        ("negative", "negative"),
        ("millimetres", "uint16"),
        ("float millimetres", "look like millimetres"),
        ("centimetres as millimetres", "closer than a depth camera"),
        ("quarters of millimetres", "do not fit the camera's pose: they are typically 4 times"),
        ("zero", "all zero"),
    ],
)
def test_bad_images_get_one_clear_error(thumb_planner, depth, kind, words) -> None:
    with pytest.raises(DepthImageError, match=words):
        thumb_planner.plan(wrong(depth, kind), CAMERA)


@pytest.mark.parametrize(
    ("intrinsics", "words"),
    [
        ({"width": 640, "height": 480, "fx": 580.0, "fy": 580.0, "cx": 319.5}, "cy"),
        ({"width": 640, "height": 480, "fx": 0.0, "fy": 580.0, "cx": 319.5, "cy": 239.5}, "singular"),
        (np.eye(2), "3 x 3"),
        (np.zeros((3, 3)), "singular"),
        (np.array([[580.0, 0.0, 1e6], [0.0, 580.0, 239.5], [0.0, 0.0, 1.0]]), "no pinhole camera: with fx"),
        (np.array([[580.0, 0.0, 319.5], [0.0, 0.5, 239.5], [0.0, 0.0, 1.0]]), "no pinhole camera: with fy"),
        (np.array([[1e5, 0.0, 319.5], [0.0, 1e5, 239.5], [0.0, 0.0, 1.0]]), "no pinhole camera: with fx"),
    ],
)
def test_bad_intrinsics_get_one_clear_error(thumb_planner, depth, intrinsics, words) -> None:
    with pytest.raises(BayesgraspError, match=words):
        thumb_planner.plan(depth, intrinsics, CAMERA.pose)


def test_a_camera_below_the_table_is_refused(thumb_planner, depth) -> None:
    below = CAMERA.pose.copy()
    below[2, 3] = -0.5
    with pytest.raises(DepthImageError, match="above the table"):
        thumb_planner.plan(depth, CAMERA, below)


def test_intrinsics_in_every_form_are_the_same_camera(depth) -> None:
    numbers = {name: getattr(CAMERA, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
    cameras = [to_camera(form, depth.shape, CAMERA.pose) for form in (CAMERA, numbers, CAMERA.matrix)]
    assert all(isinstance(camera, Camera) and camera.to_dict() == CAMERA.to_dict() for camera in cameras)


def test_wrong_requests_are_refused(thumb_planner, depth) -> None:
    with pytest.raises(InvalidConfigurationError, match="top"):
        thumb_planner.plan(depth, CAMERA, top=0)
    with pytest.raises(InvalidConfigurationError, match="seed"):
        thumb_planner.plan(depth, CAMERA, seed=-1)
    with pytest.raises(InvalidConfigurationError):
        SearchConfig(num_draws=0)
    with pytest.raises(InvalidConfigurationError):
        SelectionConfig(cutting_points=0)
    with pytest.raises(InvalidConfigurationError, match="tie"):
        SelectionConfig(tie=-0.1)


def hands_of(plan) -> Hands:
    poses = torch.from_numpy(np.stack([grasp.hand_to_world for grasp in plan.grasps])).float()
    types = torch.tensor([int(grasp.grasp_type) for grasp in plan.grasps])
    return Hands(poses[:, :3, 3], poses[:, :3, :3], types)


@pytest.mark.parametrize("eye", [(0.40, 0.0, 0.70), (-0.25, 0.35, 0.65)])
def test_the_posterior_is_the_one_that_the_plan_was_made_from(thumb_planner, eye) -> None:
    """In the world frame, also where the workspace is turned against it."""
    camera = CAMERA.with_pose(look_at(np.array(eye), np.array([0.0, 0.0, 0.05])))
    depth = box_depth_image(camera, (Box(x=0.02, y=-0.03, yaw=0.4),))
    plan = thumb_planner.plan(depth, camera, samples=400, seed=4)
    posterior = thumb_planner.posterior(depth, camera, seed=4)
    assert plan.observed.image.shape == (160, 256)
    expected = torch.tensor([grasp.log_posterior for grasp in plan.grasps])
    chance = torch.tensor([grasp.success_probability for grasp in plan.grasps])
    for found in (plan.posterior, posterior):
        torch.testing.assert_close(found.log_prob(hands_of(plan)), expected, atol=2e-3, rtol=0)
        torch.testing.assert_close(found.success_probability(hands_of(plan)), chance, atol=1e-4, rtol=1e-3)
    assert posterior.evidence == plan.posterior.evidence
    tips = plan.samples.hands.position + plan.samples.hands.rotation @ torch.tensor([0.13, 0.0, 0.0])
    np.testing.assert_allclose(tips.mean(0)[:2], (0.02, -0.03), atol=0.015)
    assert posterior.log_prob(posterior.mode()) >= expected.max() - 0.1


def test_without_an_object_there_is_no_posterior(thumb_planner) -> None:
    with pytest.raises(DepthImageError, match="nothing on the table"):
        thumb_planner.posterior(box_depth_image(CAMERA), CAMERA)


def test_many_images_are_planned_as_each_alone(thumb_planner, depth) -> None:
    side = CAMERA.with_pose(look_at(np.array([-0.25, 0.35, 0.65]), np.array([0.0, 0.0, 0.05])))
    images = [
        (depth, CAMERA),
        (box_depth_image(side, (Box(x=-0.02),)), side),
        (box_depth_image(CAMERA), CAMERA),
        (depth, CAMERA.with_pose(None)),
    ]
    together = thumb_planner.plan_many(iter(images), top=2, samples=50, seed=5)
    assert [plan.reason is None for plan in together] == [True, True, False, True]
    for plan, image in zip(together, images, strict=True):
        alone = thumb_planner.plan(*image, top=2, samples=50, seed=5)
        assert without_times(plan) == without_times(alone)
        if alone.samples is not None:
            assert torch.equal(plan.samples.hands.position, alone.samples.hands.position)


def without_times(plan) -> dict:
    return {name: value for name, value in plan.to_dict().items() if name != "timings_ms"}


def test_of_many_images_the_wrong_one_is_named(thumb_planner, depth) -> None:
    with pytest.raises(DepthImageError, match=r"image 1: .*negative"):
        thumb_planner.plan_many([(depth, CAMERA), (-depth, CAMERA)])
    assert thumb_planner.plan_many([]) == ()


def test_a_low_camera_that_sees_nothing_but_the_object_is_no_wrong_unit() -> None:
    """From 10 degrees the table returns nothing, nor does a glass's stem; behind its bowl the table is metres away."""
    eye = 0.76 * np.array([np.cos(np.radians(10)), 0.0, np.sin(np.radians(10))])
    camera = CAMERA.with_pose(look_at(eye, np.array([0.0, 0.0, 0.05])))
    thing = box_depth_image(camera, (Box(size=(0.06, 0.06, 0.25)),))
    height = eye[2] + thing * (camera.rays() @ camera.pose[2, :3])
    bowl = np.where((thing < 0.9) & (height > 0.09), thing, np.float32(0))
    check_scale(bowl, camera)
    with pytest.raises(DepthImageError, match="do not fit the camera's pose"):
        check_scale(4 * thing, camera)
