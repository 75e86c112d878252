"""The prior of scenes, p(Mesh) p(beta) p(p_O) (paper, section 2 and its table of priors)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.prior.ranges import Interval, check_interval, uniform
from bayesgrasp.types import Scenes


@dataclass(frozen=True)
class ScenePrior:
    """One object of an ordered set, its scale, and its planar pose; all independent.

    Attributes:
        num_objects: Size of the object set that `Scenes.object_index` points into.
        weights: Relative probabilities of the objects; None for the paper's uniform choice. A data set drawn with
            weights is not a draw from the paper's prior unless its records are weighted back.
        scale: Interval of beta.
        x, y: Intervals of the object's place on the table, metres.
        yaw: Interval of its rotation about the vertical, radians.

    Raises:
        InvalidConfigurationError: No objects, weights of another number or not summing above 0, a bad interval.
    """

    num_objects: int
    weights: tuple[float, ...] | None = None
    scale: Interval = (0.9, 1.1)
    x: Interval = (-0.05, 0.05)
    y: Interval = (-0.05, 0.05)
    yaw: Interval = (-math.pi, math.pi)

    def __post_init__(self) -> None:
        if self.num_objects < 1:
            raise InvalidConfigurationError(f"a scene prior needs at least one object, got {self.num_objects}")
        for name in ("x", "y", "yaw"):
            check_interval(name, getattr(self, name))
        check_interval("scale", self.scale, minimum=1e-3)
        if self.weights is not None:
            self._check_weights(self.weights)

    def _check_weights(self, weights: tuple[float, ...]) -> None:
        valid = all(math.isfinite(w) and w >= 0 for w in weights) and sum(weights) > 0
        if len(weights) != self.num_objects or not valid:
            raise InvalidConfigurationError(
                f"weights must be {self.num_objects} finite numbers >= 0 with a positive sum, got {weights}"
            )

    @property
    def probabilities(self) -> Float64[np.ndarray, "objects"]:
        """Probability of each object."""
        weights = np.ones(self.num_objects) if self.weights is None else np.array(self.weights, dtype=np.float64)
        shares: Float64[np.ndarray, "objects"] = weights / weights.sum()
        return shares

    def sample(self, n: int, rng: np.random.Generator) -> Scenes:
        """Scenes of length n."""
        index = rng.choice(self.num_objects, size=n, p=self.probabilities).astype(np.int32)
        scale = uniform(rng, self.scale, n)
        return Scenes(index, scale, self.sample_pose(n, rng))

    def sample_pose(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Planar poses (x, y, yaw) alone, float32, shape (n, 3)."""
        return np.stack([uniform(rng, interval, n) for interval in (self.x, self.y, self.yaw)], axis=-1)

    def in_support(self, scenes: Scenes) -> np.ndarray:
        """Whether object, scale and pose are possible, shape (n,), bool. Any yaw is taken modulo a full turn."""
        index = scenes.object_index
        known = (index >= 0) & (index < self.num_objects)
        possible = known & (self.probabilities[np.where(known, index, 0)] > 0)
        x, y, yaw = scenes.object_pose.T
        turned = self.yaw[0] + np.mod(yaw - self.yaw[0], 2 * math.pi)
        inside: np.ndarray = (
            possible
            & _within(scenes.scale, self.scale)
            & _within(x, self.x)
            & _within(y, self.y)
            & (turned <= self.yaw[1] + 1e-6)
        )
        return inside


def _within(values: np.ndarray, interval: Interval) -> np.ndarray:
    return (values >= interval[0]) & (values <= interval[1])
