"""The prior of hand configurations, p(h) = p(x) p(R) p(g) (paper, section 2 and its table of priors).

Densities are with respect to Lebesgue measure on R^3 (metres), the surface measure of S^3 for the rotation (total
2 pi^2; see `power_spherical`) and the counting measure on grasp types.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.prior.power_spherical import LOG_UNIFORM_ROTATION, RotationMixture, check_concentration, downward_modes
from bayesgrasp.prior.ranges import Interval, check_interval, uniform
from bayesgrasp.types import GraspType, Hands


@dataclass(frozen=True)
class GraspPrior:
    """Uniform position in a box, rotation about four downward modes, uniform grasp type.

    Attributes:
        x, y, z: The box of the palm origin in the world frame, metres.
        kappa: Concentration of each rotation mode.
        rotation: "modes" for the paper's mixture, "uniform" for the uniform rotation that the paper compares it with.
        types: The grasp types in use, each equally likely.

    Raises:
        InvalidConfigurationError: An empty box, kappa <= 0, an unknown rotation prior, no or unknown grasp types.
    """

    x: Interval = (-0.15, 0.15)
    y: Interval = (-0.15, 0.15)
    z: Interval = (0.12, 0.34)
    kappa: float = 30.0
    rotation: Literal["modes", "uniform"] = "modes"
    types: tuple[int, ...] = tuple(int(t) for t in GraspType)

    def __post_init__(self) -> None:
        for name in ("x", "y", "z"):
            check_interval(name, getattr(self, name))
            if getattr(self, name)[0] == getattr(self, name)[1]:
                raise InvalidConfigurationError(f"the box of positions is empty: {name} must have low < high")
        check_concentration(self.kappa)
        if self.rotation not in ("modes", "uniform"):
            raise InvalidConfigurationError(f"rotation must be 'modes' or 'uniform', got {self.rotation!r}")
        known = {int(t) for t in GraspType}
        if not self.types or len(set(self.types)) < len(self.types) or not set(self.types) <= known:
            raise InvalidConfigurationError(f"types must be distinct values out of {sorted(known)}, got {self.types}")

    @property
    def low(self) -> tuple[float, float, float]:
        """Lower corner of the box of positions, metres."""
        return self.x[0], self.y[0], self.z[0]

    @property
    def high(self) -> tuple[float, float, float]:
        """Upper corner of the box of positions, metres."""
        return self.x[1], self.y[1], self.z[1]

    def sample(self, n: int, rng: np.random.Generator) -> Hands:
        """Hands of batch shape (n,), float32, all of them inside the support."""
        position = np.stack([uniform(rng, box, n) for box in (self.x, self.y, self.z)], axis=-1)
        rotation = self._sample_rotation(n, rng)
        types = np.array(self.types, dtype=np.int64)[rng.integers(len(self.types), size=n)]
        return Hands(torch.from_numpy(position), rotation, torch.from_numpy(types))

    def _sample_rotation(self, n: int, rng: np.random.Generator) -> Float[Tensor, "{n} 3 3"]:
        if self.rotation == "modes":
            return self._mixture.sample(n, rng).float()
        return so3.random_rotation(n, rng)

    def log_prob(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Log density; -inf outside the support, finite for every hand inside it.

        Differentiable in position and rotation. The gradient in the position is null (paper, section 3.2), outside
        too: keeping a search inside the box is the searcher's part, with `in_support`.
        """
        inside = self.log_prob_position() + self.log_prob_rotation(hands.rotation) - math.log(len(self.types))
        inside = inside + 0 * hands.position.sum(-1)  # a null gradient rather than none
        return torch.where(self.in_support(hands), inside, -math.inf)

    def log_prob_position(self) -> float:
        """Log density of any position inside the box."""
        return -sum(math.log(high - low) for low, high in (self.x, self.y, self.z))

    def log_prob_rotation(self, rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch"]:
        """Log density of a rotation with respect to the surface measure of S^3."""
        if self.rotation == "modes":
            return self._mixture.log_prob(rotation)
        return LOG_UNIFORM_ROTATION + 0 * rotation.sum((-2, -1))

    def in_support(self, hands: Hands) -> Bool[Tensor, "*batch"]:
        """Whether the position is inside the box and the grasp type is in use."""
        low, high = hands.position.new_tensor(self.low), hands.position.new_tensor(self.high)
        inside = ((hands.position >= low) & (hands.position <= high)).all(-1)
        types = torch.tensor(self.types, device=hands.grasp_type.device)
        return inside & torch.isin(hands.grasp_type, types)

    @cached_property
    def _mixture(self) -> RotationMixture:
        return RotationMixture(downward_modes(), self.kappa)
