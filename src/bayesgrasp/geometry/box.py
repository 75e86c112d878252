"""An axis-aligned box: the support of the prior's positions, or a part of the room that a hand must stay out of."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from operator import lt

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError


@dataclass(frozen=True)
class Box:
    """All points between two corners, the faces included.

    Attributes:
        low: Lower corner, metres, world frame.
        high: Upper corner.

    Raises:
        InvalidConfigurationError: A corner is not finite, or low is not below high in every coordinate.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def __post_init__(self) -> None:
        low, high = (tuple(float(value) for value in corner) for corner in (self.low, self.high))
        if len(low) != 3 or len(high) != 3 or not all(map(math.isfinite, low + high)):
            raise InvalidConfigurationError(f"a corner of a box is 3 finite numbers, got {self.low} and {self.high}")
        if not all(map(lt, low, high)):
            raise InvalidConfigurationError(f"box needs low < high in every coordinate, got {low} and {high}")
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)

    def corners(self, like: Float[Tensor, "..."]) -> tuple[Float[Tensor, "3"], Float[Tensor, "3"]]:
        """Both corners on the device and with the type of ``like``, rounded inwards."""
        return _corners(self, like.dtype, like.device)

    def clip(self, position: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
        """The nearest positions inside."""
        low, high = self.corners(position)
        return torch.minimum(torch.maximum(position, low), high)

    def contains(self, position: Float[Tensor, "*batch 3"]) -> Bool[Tensor, "*batch"]:
        """Whether each position is inside."""
        low, high = self.corners(position)
        return ((position >= low) & (position <= high)).all(-1)


@lru_cache(maxsize=16)
def _corners(box: Box, dtype: torch.dtype, device: torch.device) -> tuple[Tensor, Tensor]:
    """A bound such as 0.15 has no exact float32; the nearest one may be outside, so step inwards where it is."""
    corners = []
    for values, inwards in ((box.low, torch.inf), (box.high, -torch.inf)):
        exact = torch.tensor(values, dtype=torch.float64, device=device)
        rounded = exact.to(dtype)
        outside = (rounded.double() - exact) * inwards < 0
        corners.append(torch.where(outside, rounded.nextafter(torch.full_like(rounded, inwards)), rounded))
    return corners[0], corners[1]
