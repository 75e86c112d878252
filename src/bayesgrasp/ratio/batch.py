"""What every estimator is trained on: B scenes, each with one image and K hands attempted on the object in it.

The hands of a scene come from attempts on the same mesh and scale, moved into the scene's pose (planar refresh,
`docs/method.md`). One encoding of the image is shared by its K hands, since the convolutions cost a thousand times
more than the head.

Two weights go with a hand, for two uses:

* `weight` makes the hands of all scenes stand for p(h, O, p_O) p(S | h, O, p_O): what ratios of densities need;
* `selection_weight` undoes only the choice of hands by their outcome: enough for p(S = 1 | i, h), which is the same
  whatever law the pairs (i, h) come from, and of less variance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float, Int
from torch import Tensor

from bayesgrasp.types import Hands


@runtime_checkable
class Batch(Protocol):
    """B scenes with K hands each; tensors on one device. The loader's own class and `TensorBatch` both fit."""

    @property
    def hands(self) -> Hands:
        """Hands in the world frame, batch shape (B, K)."""
        ...

    @property
    def success(self) -> Tensor:
        """S of each hand, 0 or 1, (B, K) float32."""
        ...

    @property
    def weight(self) -> Tensor:
        """Importance weight of each hand, not negative, 0 for padding, (B, K) float32."""
        ...

    @property
    def selection_weight(self) -> Tensor:
        """The weight of its selection alone, 0 for padding, (B, K) float32."""
        ...

    @property
    def images(self) -> Tensor:
        """Depth images, (B, 1, height, width) float32 metres, 0 = no return."""
        ...

    @property
    def object_index(self) -> Tensor:
        """Mesh of each scene, (B,) int64."""
        ...

    @property
    def scale(self) -> Tensor:
        """Scale beta of each scene, (B,) float32."""
        ...

    @property
    def object_pose(self) -> Tensor:
        """(x, y, yaw) of each scene, (B, 3) float32, metres and radians."""
        ...

    @property
    def friction(self) -> Tensor:
        """Lateral friction coefficient of each attempt, (B, K) float32."""
        ...


@dataclass(frozen=True)
class TensorBatch:
    """A `Batch` held as plain tensors; the shapes are those of the protocol."""

    hands: Hands
    success: Float[Tensor, "b k"]
    weight: Float[Tensor, "b k"]
    selection_weight: Float[Tensor, "b k"]
    images: Float[Tensor, "b 1 height width"]
    object_index: Int[Tensor, "b"]
    scale: Float[Tensor, "b"]
    object_pose: Float[Tensor, "b 3"]
    friction: Float[Tensor, "b k"]

    def __getitem__(self, index: Tensor | slice) -> TensorBatch:
        return TensorBatch(
            self.hands[index],
            self.success[index],
            self.weight[index],
            self.selection_weight[index],
            self.images[index],
            self.object_index[index],
            self.scale[index],
            self.object_pose[index],
            self.friction[index],
        )


def on_device(batch: Batch, device: torch.device) -> TensorBatch:
    """The batch on another device, hands and labels in float32."""
    return TensorBatch(
        batch.hands.to(device, torch.float32),
        batch.success.to(device, torch.float32),
        batch.weight.to(device, torch.float32),
        batch.selection_weight.to(device, torch.float32),
        batch.images.to(device),
        batch.object_index.to(device),
        batch.scale.to(device),
        batch.object_pose.to(device),
        batch.friction.to(device),
    )
