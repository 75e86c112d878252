"""What is no plan, and what is doubted: unlikely grasps, a wanted confidence, wrong poses, scenes of another kind."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from box_scene import Box, box_depth_image
from scipy.spatial.transform import Rotation

import bayesgrasp
from bayesgrasp.errors import DepthImageError, InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.planning.constraints import Constraints
from bayesgrasp.planning.planner import Planner, PlannerConfig
from bayesgrasp.planning.selection import SelectionConfig
from bayesgrasp.seeding import generator

CAMERA = canonical_camera()
BLOCK = Box(size=(0.05, 0.05, 0.10))


def noisy(depth: np.ndarray) -> np.ndarray:
    noise = 0.0015 * generator(0).standard_normal(depth.shape)
    return np.where(depth > 0, depth + noise, 0.0).astype(np.float32)


@pytest.fixture(scope="module")
def depth() -> np.ndarray:
    return box_depth_image(CAMERA, (Box(x=0.02, y=-0.03, yaw=0.4),))


@pytest.fixture(scope="module")
def shipped() -> Planner:
    return bayesgrasp.load()


@dataclass(frozen=True)
class Record:
    """What plans delivered, made up."""

    least: float | None
    objects: str = "made up"

    def least_promise(self, wanted: float) -> float | None:
        return self.least


def promising(planner: Planner, probability: float, delivered: Record | None = None) -> Planner:
    """A planner to which all grasps are equally likely to succeed."""
    likelihood = replace(
        planner.likelihood, success_probability=lambda value: 0 * value + probability, delivered=delivered
    )
    return replace(planner, likelihood=likelihood)


def test_grasps_more_likely_to_fail_are_no_plan(thumb_planner, depth) -> None:
    plan = promising(thumb_planner, 0.31).plan(depth, CAMERA)
    assert plan.grasps == ()
    assert plan.reason.startswith("not likely enough: the best grasp has an estimated success of 31 %, at least 50 %")
    assert promising(thumb_planner, 0.51).plan(depth, CAMERA).grasps


def test_whoever_wants_any_grasp_can_have_it(thumb_planner, depth) -> None:
    config = PlannerConfig(selection=SelectionConfig(least_success=0.0))
    assert replace(promising(thumb_planner, 0.31), config=config).plan(depth, CAMERA).grasps
    with pytest.raises(InvalidConfigurationError, match="probability"):
        SelectionConfig(least_success=1.5)


def test_ranked_by_the_posterior_unlikely_grasps_are_refused_too(thumb_planner, depth) -> None:
    config = PlannerConfig(selection=SelectionConfig(rank="posterior", least_success=0.9))
    plan = replace(thumb_planner, config=config).plan(depth, CAMERA, top=5)
    assert all(grasp.success_probability >= 0.9 for grasp in plan.grasps)
    every = replace(config, selection=SelectionConfig(rank="posterior", least_success=0.0))
    free = replace(thumb_planner, config=every).plan(depth, CAMERA, top=5)
    assert any(grasp.success_probability < 0.9 for grasp in free.grasps)


def test_a_confidence_asks_for_what_was_found_to_deliver_it(thumb_planner, depth) -> None:
    limits = Constraints(confidence=0.95)
    planner = promising(thumb_planner, 0.9, Record(0.88))
    plan = planner.plan(depth, CAMERA, constraints=limits)
    assert plan.grasps
    assert plan.to_dict()["constraints"]["confidence"] == 0.95
    refused = promising(thumb_planner, 0.9, Record(0.92)).plan(depth, CAMERA, constraints=limits)
    assert "at least 92 % is asked for" in refused.reason
    unknown = promising(thumb_planner, 0.9, Record(None)).plan(depth, CAMERA, constraints=limits)
    assert unknown.reason.startswith("not confident enough: no promise of this model was found to succeed in 95 %")
    assert "search" not in unknown.timings_ms


def test_a_confidence_never_asks_for_less_than_the_planner_does(thumb_planner, depth) -> None:
    planner = promising(thumb_planner, 0.4, Record(0.3))
    assert not planner.plan(depth, CAMERA, constraints=Constraints(confidence=0.5)).grasps


def test_a_model_that_was_never_calibrated_has_no_confidence(thumb_planner, depth) -> None:
    with pytest.raises(InvalidConfigurationError, match="bayesgrasp calibrate"):
        thumb_planner.plan(depth, CAMERA, constraints=Constraints(confidence=0.9))
    with pytest.raises(InvalidConfigurationError, match="between 0 and 1"):
        Constraints(confidence=95.0)


def misstated(turn: tuple[float, float, float], shift: tuple[float, float, float]) -> Camera:
    pose = CAMERA.pose.copy()
    pose[:3, :3] = Rotation.from_rotvec(turn, degrees=True).as_matrix() @ pose[:3, :3]
    pose[:3, 3] += shift
    return CAMERA.with_pose(pose)


@pytest.mark.parametrize(
    ("turn", "shift", "words"),
    [
        ((1.2, 0.0, 0.0), (0.0, 0.0, 0.0), "tilted by 1.2 degrees"),
        ((0.0, -5.0, 0.0), (0.0, 0.0, 0.0), "tilted by 5.0 degrees"),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.012), "12 mm higher"),
        ((0.0, 0.0, 0.0), (0.0, 0.0, -0.02), "20 mm lower"),
    ],
)
def test_a_wrong_pose_is_noticed_and_corrected_where_allowed(thumb_planner, turn, shift, words) -> None:
    depth = noisy(box_depth_image(CAMERA, (BLOCK,)))
    wrong = misstated(turn, shift)
    plan = thumb_planner.plan(depth, wrong)
    assert any(words in warning and "--refine-pose" in warning for warning in plan.warnings)
    np.testing.assert_array_equal(plan.observed.camera_to_world, wrong.pose)
    refined = thumb_planner.refining_pose().plan(depth, wrong)
    assert any(words in warning and "was corrected" in warning for warning in refined.warnings)
    np.testing.assert_allclose(refined.observed.camera_to_world, CAMERA.pose, atol=0.004)
    tip = refined.grasps[0].hand_to_world @ [0.13, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(tip[:2], (0.0, 0.0), atol=0.04)


@pytest.mark.parametrize(("turn", "shift"), [((0.7, 0.0, 0.0), (0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.007))])
def test_a_pose_as_good_as_can_be_asked_is_not_doubted(thumb_planner, turn, shift) -> None:
    depth = noisy(box_depth_image(CAMERA, (BLOCK,)))
    for planner in (thumb_planner, thumb_planner.refining_pose()):
        plan = planner.plan(depth, misstated(turn, shift))
        assert plan.warnings == ()
        np.testing.assert_array_equal(plan.observed.camera_to_world, misstated(turn, shift).pose)


def floating(size: tuple[float, float, float], height: float) -> np.ndarray:
    """Depth of a box in the air in front of the table."""
    lowered = CAMERA.pose.copy()
    lowered[2, 3] -= height
    in_air = box_depth_image(CAMERA.with_pose(lowered), (Box(size=size),))
    behind = box_depth_image(CAMERA.with_pose(lowered))
    table = box_depth_image(CAMERA)
    return np.where(in_air < behind, np.minimum(in_air, table), table)


ODD = {
    "50 cm box": (box_depth_image(CAMERA, (Box(x=-0.3, size=(0.5, 0.5, 0.5)),)), "estimated success", None),
    "wide box": (box_depth_image(CAMERA, (Box(size=(0.25, 0.25, 0.2)),)), "not likely enough", None),
    "wall": (np.full((480, 640), 0.8, np.float32), "nothing on the table", "no table is seen"),
    "floating": (floating((0.06, 0.06, 0.06), 0.10), None, "seems to float"),
    "high above": (floating((0.06, 0.06, 0.06), 0.20), None, "seems to float"),
    "neighbour": (box_depth_image(CAMERA, (BLOCK, replace(BLOCK, y=0.13))), None, "another thing stands 8 cm"),
    "close by": (box_depth_image(CAMERA, (BLOCK, replace(BLOCK, y=0.08))), None, "another thing stands 3 cm"),
    "arm above": (
        np.minimum(box_depth_image(CAMERA, (BLOCK,)), floating((0.08, 0.5, 0.08), 0.25)),
        None,
        "something hangs",
    ),
}


@pytest.mark.parametrize("name", ODD)
def test_odd_scenes_are_refused_or_warned_of(shipped, name) -> None:
    depth, reason, warning = ODD[name]
    plan = shipped.plan(noisy(depth), CAMERA)
    if reason is not None:
        assert plan.grasps == ()
        assert reason in plan.reason
    if warning is not None:
        assert any(warning in words for words in plan.warnings)


def test_noise_is_refused(shipped) -> None:
    noise = generator(5).uniform(0.4, 1.2, (480, 640)).astype(np.float32)
    plan = shipped.plan(noise, CAMERA)
    assert plan.grasps == ()
    assert any("no table is seen" in words for words in plan.warnings)


def test_a_box_that_fills_the_view_is_an_error(shipped) -> None:
    with pytest.raises(DepthImageError, match="do not fit the camera's pose"):
        shipped.plan(noisy(box_depth_image(CAMERA, (Box(size=(0.5, 0.5, 0.5)),))), CAMERA)


def test_a_single_block_is_planned_without_a_doubt(shipped) -> None:
    plan = shipped.plan(noisy(box_depth_image(CAMERA, (BLOCK,))), CAMERA)
    assert plan.grasps
    assert plan.warnings == ()
