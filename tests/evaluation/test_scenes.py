"""Scenes depend on the seed and their number only."""

import numpy as np
import pytest
import torch

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.scenes import SceneMaker, ScenePriors
from bayesgrasp.geometry.camera import network_camera
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.prior.cameras import cameras_at
from bayesgrasp.types import Hands


def test_a_scene_depends_on_seed_and_number_only(scenes: SceneMaker, objects: tuple[ObjectAsset, ...]) -> None:
    first, again = scenes.make(4), SceneMaker(objects, seed=3).make(4)
    np.testing.assert_array_equal(first.depth, again.depth)
    assert first.pose == again.pose
    assert first.nuisances.lateral_friction == again.nuisances.lateral_friction
    assert not np.array_equal(SceneMaker(objects, seed=4).make(4).depth, first.depth)
    assert scenes.make(6).pose != first.pose


def test_objects_take_turns(scenes: SceneMaker) -> None:
    assert [scenes.make(number).asset.id for number in range(3)] == [
        "household_carton",
        "household_tea_box",
        "household_carton",
    ]


def test_attempts_share_the_scene(scenes: SceneMaker) -> None:
    situation = scenes.make(1)
    hands = Hands(torch.zeros(2, 3), torch.eye(3).expand(2, 3, 3), torch.tensor([0, 2]))
    attempts = situation.attempts(hands)
    assert len(attempts) == 2
    assert attempts.object_index.tolist() == [1, 1]
    np.testing.assert_array_equal(attempts.object_pose, np.repeat(situation.scene.object_pose, 2, axis=0))
    np.testing.assert_array_equal(attempts.quaternion[1], [1, 0, 0, 0])
    assert attempts.grasp_type.tolist() == [0, 2]


def test_scenes_need_an_object() -> None:
    with pytest.raises(InvalidConfigurationError, match="at least one object"):
        SceneMaker((), 0)


def test_images_may_be_taken_from_any_side(objects: tuple[ObjectAsset, ...]) -> None:
    priors = ScenePriors(camera=cameras_at(np.radians(30.0), azimuth=(2.0, 2.0)))
    situation = SceneMaker(objects, seed=3, priors=priors).make(0)
    known = SceneMaker(objects, seed=3).make(0)
    assert np.degrees(np.arcsin(-situation.camera.pose[2, 2])) == pytest.approx(30.0, abs=1e-3)
    assert not np.array_equal(situation.workspace_to_world, np.eye(4))
    np.testing.assert_array_equal(known.workspace_to_world, np.eye(4))
    # The object is found where it is, and what is chosen in the frame of the image comes back to the world.
    middle = SurfaceReader(network_camera()).read(situation.image).item_points.mean(0)
    there = situation.in_world(Hands(torch.from_numpy(middle)[None], torch.eye(3)[None], torch.zeros(1).long()))
    assert np.linalg.norm(there.position[0, :2].numpy() - situation.pose[:2]) < 0.06
    np.testing.assert_allclose(there.rotation[0].numpy(), situation.workspace_to_world[:3, :3], atol=1e-6)
