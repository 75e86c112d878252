"""Mirrored scenes: each scene stands for its mirror image in the vertical plane through the camera's axis.

With M = diag(1, -1, 1), a mirrored object that a mirrored hand grasps in a mirrored world succeeds as often. The hand
is its own mirror image in its x-y plane (the fingers b and c change places), so the mirrored configuration is

    x' = M x,    R' = M R diag(1, 1, -1),    g' = g,

a proper rotation. The canonical camera stands in the mirror plane, so the mirrored image is the image read from right
to left. Two symmetries are not exact: a structured-light shadow then falls on the other side, and the arm's reach is
not its own mirror image. They are the price of twice as many objects.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.ratio.batch import Batch, TensorBatch, on_device
from bayesgrasp.ratio.evidence import ViewConfig
from bayesgrasp.ratio.train import Source
from bayesgrasp.seeding import generator
from bayesgrasp.types import Hands

MIRROR = 7
"""Random stream: ``generator(seed, MIRROR, epoch, batch)``."""


def check_mirror(view: ViewConfig) -> None:
    """Refuse a camera that is not its own mirror image.

    Raises:
        InvalidConfigurationError: The camera is off the plane y = 0, looks out of it, or is off-centre.
    """
    rotation = np.array(view.rotation)
    off = max(abs(view.translation[1]), abs(rotation[1, 1]), abs(rotation[1, 2]))
    if off > 1e-6 or abs(view.center[0] - 0.5 * (view.width - 1)) > 1e-6:
        raise InvalidConfigurationError("mirrored training needs a camera in the plane y = 0 with a centred image")


def mirrored(batch: TensorBatch, which: Bool[Tensor, "b"]) -> TensorBatch:
    """The batch with some of its scenes mirrored."""
    sign = torch.where(which, -1.0, 1.0)
    across = torch.ones(len(sign), 3)
    across[:, 1] = sign
    position = batch.hands.position * across[:, None]
    rotation = batch.hands.rotation * across[:, None, :, None]
    rotation = torch.cat([rotation[..., :2], rotation[..., 2:] * sign[:, None, None, None]], -1)
    return replace(
        batch,
        hands=Hands(position, rotation, batch.hands.grasp_type),
        images=torch.where(which[:, None, None, None], batch.images.flip(-1), batch.images),
        object_pose=batch.object_pose * torch.stack([torch.ones_like(sign), sign, sign], -1),
    )


@dataclass(frozen=True)
class Mirrored:
    """A source of batches, half of whose scenes are mirrored, anew every epoch.

    Attributes:
        source: The batches.
        seed: Of the choice.
    """

    source: Source
    seed: int

    def __len__(self) -> int:
        """Batches in an epoch."""
        return len(self.source)

    def __call__(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch."""
        for number, batch in enumerate(self.source(epoch)):
            coin = generator(self.seed, MIRROR, epoch, number).random(len(batch.success)) < 0.5
            yield mirrored(on_device(batch, torch.device("cpu")), torch.from_numpy(coin))
