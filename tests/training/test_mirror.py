"""A mirrored scene is a scene: proper rotations, an involution, and the same local evidence for the mirrored hand."""

from collections.abc import Callable
from dataclasses import replace

import torch

from bayesgrasp.data.schema import Batch
from bayesgrasp.ratio.evidence import HandPoints, PointsConfig, canonical_view, sample
from bayesgrasp.training.mirror import mirrored, mirrored_at_random

MakeBatch = Callable[..., Batch]
ALL = torch.tensor([True, True])


def test_mirroring_twice_changes_nothing(batch: MakeBatch) -> None:
    two = batch(2, 4, 0)
    twice = mirrored(mirrored(two, ALL), ALL)
    for name in ("position", "rotation"):
        assert torch.equal(getattr(twice.hands, name), getattr(two.hands, name))
    assert torch.equal(twice.images, two.images)
    assert torch.equal(twice.object_pose, two.object_pose)


def test_mirrored_hands_have_proper_rotations_and_keep_height_and_approach_angle(batch: MakeBatch) -> None:
    two = batch(2, 4, 0)
    other = mirrored(two, ALL).hands
    torch.testing.assert_close(torch.linalg.det(other.rotation), torch.ones(2, 4))
    assert torch.equal(other.position[..., 2], two.hands.position[..., 2])
    assert torch.equal(other.rotation[..., 2, 0], two.hands.rotation[..., 2, 0])
    assert torch.equal(other.position[..., 1], -two.hands.position[..., 1])


def test_the_mirrored_hand_meets_the_same_depths_in_the_mirrored_image(batch: MakeBatch) -> None:
    two = batch(2, 4, 0)
    rng = torch.Generator().manual_seed(0)
    smooth = torch.nn.functional.interpolate(
        0.6 + 0.3 * torch.rand(2, 1, 5, 8, generator=rng), (160, 256), mode="bilinear"
    )
    scene = replace(two, images=smooth)
    points = HandPoints(PointsConfig(canonical_view()))

    def evidence(some: Batch) -> torch.Tensor:
        grid, depth = points(some.hands)
        return (depth - sample(some.images, grid)[:, 0]).sort(-1).values

    torch.testing.assert_close(evidence(mirrored(scene, ALL)), evidence(scene), atol=1e-4, rtol=0)
    wrong = replace(scene, images=scene.images.flip(-1))
    assert (evidence(wrong) - evidence(scene)).abs().max() > 0.01


def test_a_share_of_the_scenes_is_mirrored(batch: MakeBatch) -> None:
    many = batch(400, 1, 0)
    rng = torch.Generator().manual_seed(0)
    changed = mirrored_at_random(many, 0.5, rng).hands.position[:, 0, 1] != many.hands.position[:, 0, 1]
    assert 150 < changed.sum() < 250
    assert mirrored_at_random(many, 0.0, rng) is many
