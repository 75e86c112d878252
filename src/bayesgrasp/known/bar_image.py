"""The observation of the analytic problem: a small depth image, from above, of a bar on a table, with white noise.

    i = T_o + sigma n,    T_o = table depth - height exp(-(u / a)^2 / 2 - (v / b)^2 / 2),

where (u, v) are the coordinates of a pixel along and across the bar. Among finitely many poses o, p(o | i) is exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError


@dataclass(frozen=True)
class BarImage:
    """The image model; rows show world x downwards, columns world y to the right.

    Attributes:
        size: Rows and columns.
        pixel: Side of a pixel on the table, metres.
        table_depth: Depth of the table, metres.
        height: Height of the bar, metres.
        along, across: Standard deviations a, b of its shape, metres.
        noise: sigma, metres.

    Raises:
        InvalidConfigurationError: No pixels, or a length that is not positive.
    """

    size: tuple[int, int] = (20, 32)
    pixel: float = 0.0125
    table_depth: float = 0.8
    height: float = 0.1
    along: float = 0.03
    across: float = 0.012
    noise: float = 0.08

    def __post_init__(self) -> None:
        if min(self.size) < 1:
            raise InvalidConfigurationError(f"size must be rows and columns >= 1, got {self.size}")
        for name in ("pixel", "table_depth", "height", "along", "across", "noise"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InvalidConfigurationError(f"{name} must be finite and > 0 m, got {value}")

    def templates(self, poses: Float64[np.ndarray, "n 3"]) -> Float64[Tensor, "n 1 height width"]:
        """T_o of poses (x, y, yaw), metres and radians."""
        rows, columns = ((np.arange(n) - (n - 1) / 2) * self.pixel for n in self.size)
        px, py, yaw = (poses[:, k, None, None] for k in range(3))
        x, y = rows[:, None] - px, columns[None, :] - py
        u = (np.cos(yaw) * x + np.sin(yaw) * y) / self.along
        v = (np.cos(yaw) * y - np.sin(yaw) * x) / self.across
        bar = np.exp(-0.5 * (u**2 + v**2))
        return torch.from_numpy(self.table_depth - self.height * bar)[:, None]

    def sample(
        self, templates: Float64[Tensor, "n 1 height width"], rng: np.random.Generator
    ) -> Float32[Tensor, "n 1 height width"]:
        """Draws from p(i | o), one for each template."""
        noise = rng.standard_normal(templates.shape, dtype=np.float32)
        return templates.float() + self.noise * torch.from_numpy(noise)

    def log_pose(
        self, image: Float[Tensor, "*batch 1 height width"], templates: Float64[Tensor, "K 1 height width"]
    ) -> Float64[Tensor, "*batch K"]:
        """Logarithm of p(o | i) among equally likely poses."""
        flat, shapes = (image.double() - self.table_depth).flatten(-3), (templates - self.table_depth).flatten(-3)
        # |i - T|^2 without the term |i|^2, which all poses share.
        score = flat @ shapes.mT - 0.5 * shapes.square().sum(-1)
        return torch.log_softmax(score / self.noise**2, dim=-1)
