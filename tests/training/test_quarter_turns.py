"""A turned scene is a scene: hands keep their pose relative to the object, the priors stay as they are."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.geometry.hand_arrays import attempts_of
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.nuisance import NuisancePrior
from bayesgrasp.prior.planar_symmetry import to_object
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.seeding import generator
from bayesgrasp.training.quarter_turns import turned, turned_at_random
from bayesgrasp.types import Hands, Scenes

MakeBatch = Callable[..., Batch]
QUARTERS = torch.tensor([0, 1, 2, 3])


@pytest.fixture
def blind(batch: MakeBatch) -> Batch:
    """Hands of the prior in scenes of the prior, without images."""
    rng = generator(0)
    hands = GraspPrior().sample(4, rng)[:, None]
    pose = torch.from_numpy(ScenePrior(1).sample_pose(4, rng))
    return replace(batch(4, 1, 0), hands=hands, object_pose=pose, images=torch.zeros(4, 1, 0, 0))


def relative(batch: Batch) -> tuple[np.ndarray, np.ndarray]:
    """Positions and rotations of the hands in the frames of their objects."""
    pose = batch.object_pose.numpy().astype(np.float32)
    scenes = Scenes(np.zeros(len(pose), np.int32), np.ones(len(pose), np.float32), pose)
    nuisances = NuisancePrior().sample(len(pose), generator(0))
    hands = to_object(attempts_of(batch.hands, scenes, nuisances))
    return hands.position, so3.quaternion_to_matrix(torch.from_numpy(hands.quaternion)).numpy()


def test_hands_move_with_their_objects(blind: Batch) -> None:
    for after, before in zip(relative(turned(blind, QUARTERS)), relative(blind), strict=True):
        np.testing.assert_allclose(after, before, atol=1e-6)


def test_the_priors_of_hands_and_scenes_stay(blind: Batch) -> None:
    prior, other = GraspPrior(), turned(blind, QUARTERS)
    torch.testing.assert_close(prior.log_prob(other.hands), prior.log_prob(blind.hands), atol=1e-4, rtol=0)
    scenes = Scenes(np.zeros(4, np.int32), np.ones(4, np.float32), other.object_pose.numpy())
    assert ScenePrior(1).in_support(scenes).all()


def test_every_number_of_quarters_occurs_and_four_are_none(batch: MakeBatch, blind: Batch) -> None:
    one, kinds = torch.eye(3).expand(400, 1, 3, 3), torch.zeros(400, 1, dtype=torch.int64)
    same = Hands(torch.tensor([0.1, 0.02, 0.2]).expand(400, 1, 3), one, kinds)
    many = replace(batch(400, 1, 0), hands=same, images=torch.zeros(400, 1, 0, 0))
    places = turned_at_random(many, torch.Generator().manual_seed(0)).hands.position[:, 0]
    _, counts = places.mul(1e4).round().unique(dim=0, return_counts=True)
    assert len(counts) == 4
    assert counts.min() > 60
    torch.testing.assert_close(turned(blind, QUARTERS * 0 + 4).hands.position, blind.hands.position)


def test_images_are_refused(batch: MakeBatch) -> None:
    with pytest.raises(InvalidConfigurationError, match="camera"):
        turned(batch(4, 1, 0), QUARTERS)
