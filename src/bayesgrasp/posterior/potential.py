"""The potential f(h) = -log r(S=1, i | h) - log p(h) on R^3 x SO(3) x G and its gradient (paper, section 3.2).

Any log-ratio and any prior will do: both are protocols. Terms left out give the other strategies of the paper's table:

    posterior         -log r(S=1, i | h) - log p(h)      p(h | S=1, i), MAP
    likelihood        -log r(S=1, i | h)                 p(S=1, i | h), MLE
    success ratio     the same two with r(S=1 | h)       no image
    full observation  the same two with r(S=1, O, p_O, beta, friction | h)
    prior             -log p(h)

One batch may search for several of them at once: a term can have a weight for each row (`RowWeighted`).

The Euclidean gradient G = df/dR in R^{3x3}, by autograd, is projected to R skew(R^T G) (paper, section 3.2), which is
kept as the three derivatives along R exp([w]_x): the vector of 2 skew(R^T G), in the hand frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.types import Hands


@runtime_checkable
class LogDensity(Protocol):
    """A log-density or log-ratio over hands, up to a constant; differentiable in position and rotation."""

    def __call__(self, hands: Hands) -> Tensor:
        """Values, of the hands' batch shape."""
        ...


@runtime_checkable
class WithGradient(Protocol):
    """A log-density that has a faster way to its gradient than autograd through `__call__`."""

    def value_and_grad(self, hands: Hands) -> tuple[Tensor, Tensor, Tensor]:
        """Value (*batch), Euclidean gradients by position (*batch 3) and by rotation matrix (*batch 3 3)."""
        ...


@runtime_checkable
class Prior(Protocol):
    """A prior p(h) with a box of positions as support; every rotation and every type is inside."""

    @property
    def low(self) -> Sequence[float]:
        """Lower corner of the positions, metres, world frame."""
        ...

    @property
    def high(self) -> Sequence[float]:
        """Upper corner of the positions, metres, world frame."""
        ...

    def sample(self, n: int, rng: np.random.Generator) -> Hands:
        """Draw n hands."""
        ...

    def log_prob(self, hands: Hands) -> Tensor:
        """Log-density; -inf outside the support."""
        ...


@dataclass(frozen=True)
class Box:
    """Axis-aligned support of the positions.

    Attributes:
        low: Lower corner, metres, world frame.
        high: Upper corner.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def __post_init__(self) -> None:
        if not all(lo < hi for lo, hi in zip(self.low, self.high, strict=True)):
            raise InvalidConfigurationError(f"box needs low < high in every coordinate, got {self.low} and {self.high}")

    @staticmethod
    def of(prior: Prior) -> "Box":
        """The support of a prior's positions."""
        low, high = (tuple(float(v) for v in corner) for corner in (prior.low, prior.high))
        return Box(low, high)  # type: ignore[arg-type]

    def corners(self, like: Float[Tensor, "..."]) -> tuple[Float[Tensor, "3"], Float[Tensor, "3"]]:
        """Both corners on the device and with the type of ``like``, rounded inwards."""
        return _corners(self, like.dtype, like.device)

    def clip(self, position: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
        """The nearest positions inside."""
        low, high = self.corners(position)
        return torch.minimum(torch.maximum(position, low), high)

    def contains(self, position: Float[Tensor, "*batch 3"]) -> Bool[Tensor, "*batch"]:
        """Whether each position is inside, the faces included."""
        low, high = self.corners(position)
        return ((position >= low) & (position <= high)).all(-1)


@dataclass(frozen=True)
class RowWeighted:
    """A log-density times a weight for each row of the batch.

    Attributes:
        density: Log-density.
        weight: One for each row.
    """

    density: LogDensity
    weight: Float[Tensor, "n"]

    def __call__(self, hands: Hands) -> Float[Tensor, "n"]:
        """RowWeighted values of a batch of n hands, row by row."""
        return self.weight * self.density(hands)

    def of(self, rows: slice | Int[Tensor, "m"]) -> "RowWeighted":
        """The same for some of the rows."""
        return RowWeighted(self.density, self.weight[rows])


@dataclass(frozen=True)
class Potential:
    """Negative sum of log-densities, restricted to a box of positions.

    Attributes:
        terms: The log-densities that are added up.
        box: Where it is finite.
        chunk: Largest number of hands that is evaluated at once.
    """

    terms: tuple[LogDensity, ...]
    box: Box
    chunk: int = 8192

    def __call__(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Values f(h), without gradient; +inf outside the box."""
        with torch.no_grad():
            flat = _flatten(hands)
            chunks = [slice(i, i + self.chunk) for i in range(0, max(len(flat.grasp_type), 1), self.chunk)]
            parts = [self.of(chunk)._value(flat[chunk]) for chunk in chunks]
            value = torch.cat(parts).reshape(hands.shape)
            return torch.where(self.box.contains(hands.position), value, torch.inf)

    def value_and_grad(self, hands: Hands) -> tuple[Float[Tensor, "*batch"], Float[Tensor, "*batch 6"]]:
        """Values and derivatives along the manifold.

        Returns:
            f(h), +inf outside the box; and (df/dx in 1/m, df/dw in 1/rad) with R exp([w]_x), w in the hand frame.
        """
        # One graph for all terms that rely on autograd: half of a small batch's time is the number of calls.
        own = [term for term in self.terms if isinstance(term, WithGradient)]
        other = [term for term in self.terms if not isinstance(term, WithGradient)]
        parts: list[LogDensity] = [*own, *([_Sum(tuple(other))] if other else [])]
        value, by_position, by_rotation = _sum([value_and_euclidean_grad(part, hands) for part in parts])
        value = torch.where(self.box.contains(hands.position), -value, torch.inf)
        return value, torch.cat([-by_position, -2 * so3.vee(hands.rotation.mT @ by_rotation)], -1)

    def of(self, rows: slice | Int[Tensor, "m"]) -> "Potential":
        """The potential of some rows of a batch; it differs from row to row only where a term is `RowWeighted`."""
        if not any(isinstance(term, RowWeighted) for term in self.terms):
            return self
        return replace(self, terms=tuple(t.of(rows) if isinstance(t, RowWeighted) else t for t in self.terms))

    def _value(self, hands: Hands) -> Float[Tensor, "n"]:
        return -_Sum(self.terms)(hands)


def posterior_potential(log_ratio: LogDensity, prior: Prior) -> Potential:
    """-log r - log p: its minimum is the MAP."""
    return Potential((log_ratio, prior.log_prob), Box.of(prior))


def tempered_potential(log_ratio: LogDensity, prior: Prior, weight: Float[Tensor, "n"]) -> Potential:
    """-log r - w log p with a weight w for each row of a batch of n: 1 leads to the MAP, 0 to the MLE."""
    return Potential((log_ratio, RowWeighted(prior.log_prob, weight)), Box.of(prior))


def likelihood_potential(log_ratio: LogDensity, prior: Prior) -> Potential:
    """-log r inside the prior's support: its minimum is the MLE."""
    return Potential((log_ratio,), Box.of(prior))


def prior_potential(prior: Prior) -> Potential:
    """-log p: its minimum is the mode of the prior."""
    return Potential((prior.log_prob,), Box.of(prior))


def value_and_euclidean_grad(
    density: LogDensity, hands: Hands
) -> tuple[Float[Tensor, "*batch"], Float[Tensor, "*batch 3"], Float[Tensor, "*batch 3 3"]]:
    """Value and gradients in R^3 and R^{3x3}, by the density's own method if it has one, else by autograd."""
    if isinstance(density, WithGradient):
        return density.value_and_grad(hands)
    with torch.enable_grad():
        position, rotation = hands.position.detach().requires_grad_(), hands.rotation.detach().requires_grad_()
        value = density(Hands(position, rotation, hands.grasp_type))
        if not value.requires_grad:
            return value, torch.zeros_like(position), torch.zeros_like(rotation)
        grads = torch.autograd.grad(value.sum(), (position, rotation), allow_unused=True)
    by_position, by_rotation = (
        torch.zeros_like(x) if g is None else g for g, x in zip(grads, (position, rotation), strict=True)
    )
    return value.detach(), by_position, by_rotation


@lru_cache(maxsize=16)
def _corners(box: Box, dtype: torch.dtype, device: torch.device) -> tuple[Tensor, Tensor]:
    """A bound such as 0.15 has no exact float32; the nearest one may be outside, so step inwards where it is."""
    corners = []
    for exact, inwards in ((box.low, torch.inf), (box.high, -torch.inf)):
        rounded = torch.tensor(exact, dtype=torch.float64).to(dtype)
        outside = (rounded.double() - torch.tensor(exact, dtype=torch.float64)) * inwards < 0
        corners.append(torch.where(outside, rounded.nextafter(torch.full_like(rounded, inwards)), rounded).to(device))
    return corners[0], corners[1]


@dataclass(frozen=True)
class _Sum:
    """Sum of log-densities."""

    terms: tuple[LogDensity, ...]

    def __call__(self, hands: Hands) -> Tensor:
        return sum((term(hands) for term in self.terms[1:]), start=self.terms[0](hands))


def _sum(parts: list[tuple[Tensor, Tensor, Tensor]]) -> tuple[Tensor, Tensor, Tensor]:
    value, by_position, by_rotation = parts[0]
    for part in parts[1:]:
        value, by_position, by_rotation = value + part[0], by_position + part[1], by_rotation + part[2]
    return value, by_position, by_rotation


def _flatten(hands: Hands) -> Hands:
    return Hands(hands.position.reshape(-1, 3), hands.rotation.reshape(-1, 3, 3), hands.grasp_type.reshape(-1))
