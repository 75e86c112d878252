"""Turned attempts: what a hand achieves in a scene, it achieves in the scene turned about the vertical with it.

The scenes of the prior lie in a square of places about the origin at any yaw, so a quarter turn about the vertical
takes the prior of scenes, and that of hands with its four modes, to itself. Hence p(S=1 | h) = p(S=1 | turned h), up to
the arm, which does not reach 0.5 % of the hands and stands on one side. Where no image is looked at, every attempt
therefore teaches what happens in four directions. Like mirrored scenes these are for learning from, never for judging.
"""

import math
from dataclasses import replace

import torch
from jaxtyping import Int
from torch import Tensor

from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.types import Hands


def turned(batch: Batch, quarters: Int[Tensor, "b"]) -> Batch:
    """The batch with every scene turned about the vertical through the origin.

    Args:
        batch: Scenes with hands, without pixels: the camera does not turn.
        quarters: Quarter turns of each scene.

    Raises:
        InvalidConfigurationError: The scenes have images.
    """
    if batch.images.numel():
        raise InvalidConfigurationError("scenes with images cannot be turned: the camera does not turn with them")
    angle = quarters.to(batch.hands.position) * (math.pi / 2)
    zero = torch.zeros_like(angle)
    turn = so3.exp(torch.stack([zero, zero, angle], -1))[:, None]
    position = (turn @ batch.hands.position[..., None]).squeeze(-1)
    hands = Hands(position, turn @ batch.hands.rotation, batch.hands.grasp_type)
    place = (turn[:, 0, :2, :2] @ batch.object_pose[:, :2, None]).squeeze(-1)
    pose = torch.cat([place, batch.object_pose[:, 2:] + angle[:, None]], -1)
    return replace(batch, hands=hands, object_pose=pose)


def turned_at_random(batch: Batch, rng: torch.Generator) -> Batch:
    """Turn each scene by none to three quarters; `rng` is on the CPU."""
    quarters = torch.randint(4, (len(batch.scale),), generator=rng)
    return turned(batch, quarters.to(batch.scale.device))
