"""Mirrored scenes: every scene is also one seen in a mirror, with another object and as good a grasp.

The plane y = 0 holds the camera and halves the table. In it, the image is flipped left to right, and a hand at (x, R)
goes to (M x, M R D) with M = diag(1, -1, 1): the mirrored hand is the same hand, turned, because the hand is its own
mirror image in its plane z = 0, D = diag(1, 1, -1). The type stays. Friction and gravity know no side, so S stays.

Two things do have a side: the arm (it cannot reach 0.5 % of the hands, by weight) and the shadow of the sensor's
projector. Mirrored scenes are therefore for learning from, never for judging. The mirrored object is not the mesh of
the catalogue, so an estimator that is told the mesh must not see them.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool
from torch import Tensor

from bayesgrasp.data.schema import Batch
from bayesgrasp.types import Hands


def mirrored(batch: Batch, which: Bool[Tensor, "b"]) -> Batch:
    """The batch with some of its scenes mirrored in y = 0.

    Args:
        batch: Scenes with images and hands; `object_pose` is mirrored too, `object_index` cannot be.
        which: The scenes to mirror.
    """
    position, rotation = batch.hands.position, batch.hands.rotation
    across = position.new_tensor([1.0, -1.0, 1.0])
    beside = position.new_tensor([1.0, 1.0, -1.0])
    turned = across[:, None] * rotation * beside
    hands = Hands(
        torch.where(which[:, None, None], across * position, position),
        torch.where(which[:, None, None, None], turned, rotation),
        batch.hands.grasp_type,
    )
    images = torch.where(which[:, None, None, None], batch.images.flip(-1), batch.images)
    pose = torch.where(which[:, None], batch.object_pose * batch.object_pose.new_tensor([1, -1, -1]), batch.object_pose)
    return replace(batch, hands=hands, images=images, object_pose=pose)


def mirrored_at_random(batch: Batch, share: float, rng: torch.Generator) -> Batch:
    """Mirror each scene with the probability `share`; `rng` is on the CPU."""
    if share == 0:
        return batch
    which = torch.rand(len(batch.scale), generator=rng) < share
    return mirrored(batch, which.to(batch.scale.device))
