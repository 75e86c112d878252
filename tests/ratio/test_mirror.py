"""A mirrored scene is what the simulators make of the mirrored world."""

from collections.abc import Iterator

import numpy as np
import pytest
import torch

from bayesgrasp.assets.catalogue import load_objects
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import canonical_camera, look_at
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.ratio.batch import TensorBatch
from bayesgrasp.ratio.evidence import ViewConfig, canonical_view
from bayesgrasp.ratio.mirror import Mirrored, check_mirror, mirrored
from bayesgrasp.seeding import generator
from bayesgrasp.simulators.depth import DepthSensor
from bayesgrasp.simulators.preprocess import preprocess
from bayesgrasp.types import Scenes

B, K = 3, 4


def scenes(sign: float) -> Scenes:
    pose = np.array([[0.03, 0.02, 0.7], [-0.02, -0.04, 2.0], [0.0, 0.01, -1.0]], np.float32)
    pose[:, 1:] *= sign
    return Scenes(np.zeros(B, np.int32), np.ones(B, np.float32), pose)


def batch(sign: float = 1.0) -> TensorBatch:
    """Clean images of a box, which is its own mirror image."""
    sensor = DepthSensor(load_objects(["household_tea_box"]))
    images = np.stack([preprocess(image) for image in sensor.render_clean(scenes(sign))])
    hands = GraspPrior().sample(B * K, generator(1, 0))
    hands = type(hands)(
        hands.position.reshape(B, K, 3), hands.rotation.reshape(B, K, 3, 3), hands.grasp_type.reshape(B, K)
    )
    ones = torch.ones(B, K)
    where = scenes(sign)
    return TensorBatch(
        hands=hands,
        success=ones,
        weight=ones,
        selection_weight=ones,
        images=torch.from_numpy(images)[:, None],
        object_index=torch.from_numpy(where.object_index.astype(np.int64)),
        scale=torch.from_numpy(where.scale),
        object_pose=torch.from_numpy(where.object_pose),
        friction=ones,
    )


ALL, NONE = torch.ones(B, dtype=torch.bool), torch.zeros(B, dtype=torch.bool)


def test_the_mirrored_image_is_the_image_of_the_mirrored_scene() -> None:
    reflected, simulated = mirrored(batch(1.0), ALL), batch(-1.0)
    torch.testing.assert_close(reflected.object_pose, simulated.object_pose)
    difference = (reflected.images - simulated.images).abs()
    assert (difference < 1e-3).float().mean() > 0.995, "equal but for pixels at edges"
    assert (batch(1.0).images - simulated.images).abs().max() > 0.01


def test_hands_are_mirrored_to_proper_rotations() -> None:
    before, after = batch().hands, mirrored(batch(), ALL).hands
    torch.testing.assert_close(torch.linalg.det(after.rotation), torch.ones(B, K))
    flip = torch.tensor([1.0, -1.0, 1.0])
    torch.testing.assert_close(after.position, before.position * flip)
    for axis in (0, 1):  # approach and closing directions are reflected, the third follows
        torch.testing.assert_close(after.rotation[..., axis], before.rotation[..., axis] * flip)


def test_mirroring_twice_changes_nothing_and_only_the_chosen_change() -> None:
    once, some = mirrored(batch(), ALL), mirrored(batch(), torch.tensor([True, False, False]))
    twice = mirrored(once, ALL)
    torch.testing.assert_close(twice.images, batch().images)
    torch.testing.assert_close(twice.hands.rotation, batch().hands.rotation)
    torch.testing.assert_close(some.images[1:], batch().images[1:])
    torch.testing.assert_close(some.images[:1], once.images[:1])
    torch.testing.assert_close(mirrored(batch(), NONE).hands.position, batch().hands.position)


def test_the_source_gives_the_same_batches_again() -> None:
    class Source:
        def __len__(self) -> int:
            return 4

        def __call__(self, epoch: int) -> Iterator[TensorBatch]:
            return (batch() for _ in range(4))

    source = Mirrored(Source(), seed=2)
    first, again, other = (torch.stack([b.hands.position for b in source(epoch)]) for epoch in (0, 0, 1))
    torch.testing.assert_close(first, again, rtol=0, atol=0)
    assert not torch.equal(first, other)
    assert len(source) == 4


def test_a_camera_off_the_mirror_plane_is_refused() -> None:
    check_mirror(canonical_view())
    aside = look_at(np.array([0.4, 0.1, 0.7]), np.array([0.0, 0.0, 0.05]))
    with pytest.raises(InvalidConfigurationError, match="plane y = 0"):
        check_mirror(ViewConfig.of(canonical_camera().with_pose(aside)))
