"""The potential f(h) = -log r(S=1, i | h) - log p(h) on R^3 x SO(3) x G and its gradient (paper, section 3.2).

Any log-ratio and any prior will do: both are protocols. Terms left out give the other strategies of the paper's table:

    posterior         -log r(S=1, i | h) - log p(h)      p(h | S=1, i), MAP
    likelihood        -log r(S=1, i | h)                 p(S=1, i | h), MLE
    success ratio     the same two with r(S=1 | h)       no image
    full observation  the same two with r(S=1, O, p_O, beta, friction | h)
    prior             -log p(h)

One batch may search for several of them at once: a term can have a weight for each row (`Potential.weights`).

The Euclidean gradient G = df/dR in R^{3x3}, by autograd, is projected to R skew(R^T G) (paper, section 3.2), which is
kept as the three derivatives along R exp([w]_x): the vector of 2 skew(R^T G), in the hand frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from bayesgrasp.geometry import so3
from bayesgrasp.geometry.box import Box
from bayesgrasp.types import Hands

LogDensity = Callable[[Hands], Tensor]
"""A log-density or log-ratio over hands, up to a constant: values of the hands' batch shape, differentiable in position
and rotation."""


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
class Potential:
    """Negative sum of log-densities, restricted to a box of positions and to allowed hands.

    Attributes:
        terms: The log-densities that are added up.
        box: Where it is finite.
        weights: For each term, a factor for each row of a batch, or None for 1; all 1 if empty.
        allowed: Which hands of a batch (n,) it is finite at; None for all.
        chunk: Largest number of hands that is evaluated at once.
    """

    terms: tuple[LogDensity, ...]
    box: Box
    weights: tuple[Float[Tensor, "n"] | None, ...] = ()
    allowed: Callable[[Hands], Bool[Tensor, "n"]] | None = None
    chunk: int = 8192

    def value(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Values f(h), without gradient; +inf where it is not finite."""
        flat = _flatten(hands)
        with torch.no_grad():
            parts = [-self.of(rows)._log_density(flat[rows]) for rows in _chunks(len(flat.grasp_type), self.chunk)]
        return torch.where(self._inside(hands), torch.cat(parts).reshape(hands.shape), torch.inf)

    def value_and_grad(self, hands: Hands) -> tuple[Float[Tensor, "*batch"], Float[Tensor, "*batch 6"]]:
        """Values and derivatives along the manifold.

        Returns:
            f(h), +inf where not finite; and (df/dx in 1/m, df/dw in 1/rad) with R exp([w]_x), w in the hand frame.
        """
        value, by_position, by_rotation = value_and_euclidean_grad(self._log_density, hands)
        value = torch.where(self._inside(hands), -value, torch.inf)
        return value, torch.cat([-by_position, -2 * so3.vee(hands.rotation.mT @ by_rotation)], -1)

    def of(self, rows: slice | Int[Tensor, "m"]) -> Potential:
        """The potential of some rows of a batch; it differs from row to row only where there are weights."""
        if not self.weights:
            return self
        return replace(self, weights=tuple(None if weight is None else weight[rows] for weight in self.weights))

    def _inside(self, hands: Hands) -> Bool[Tensor, "*batch"]:
        inside = self.box.contains(hands.position)
        return inside if self.allowed is None else inside & self.allowed(_flatten(hands)).reshape(hands.shape)

    def _log_density(self, hands: Hands) -> Tensor:
        weights = self.weights or (None,) * len(self.terms)
        values = [
            term(hands) if weight is None else weight * term(hands)
            for term, weight in zip(self.terms, weights, strict=True)
        ]
        return sum(values[1:], start=values[0])


def support(prior: Prior) -> Box:
    """The box of a prior's positions."""
    low, high = (tuple(float(v) for v in corner) for corner in (prior.low, prior.high))
    return Box(low, high)  # type: ignore[arg-type]


def evaluate(density: LogDensity, hands: Hands, chunk: int = 8192) -> Float[Tensor, "*batch"]:
    """Values of a log-density everywhere, without gradient, so many hands at once."""
    flat = _flatten(hands)
    with torch.no_grad():
        parts = [density(flat[rows]) for rows in _chunks(len(flat.grasp_type), chunk)]
    return torch.cat(parts).reshape(hands.shape)


def posterior_potential(log_ratio: LogDensity, prior: Prior) -> Potential:
    """-log r - log p: its minimum is the MAP."""
    return Potential((log_ratio, prior.log_prob), support(prior))


def tempered_potential(log_ratio: LogDensity, prior: Prior, weight: Float[Tensor, "n"]) -> Potential:
    """-log r - w log p with a weight w for each row of a batch of n: 1 leads to the MAP, 0 to the MLE."""
    return Potential((log_ratio, prior.log_prob), support(prior), (None, weight))


def likelihood_potential(log_ratio: LogDensity, prior: Prior) -> Potential:
    """-log r inside the prior's support: its minimum is the MLE."""
    return Potential((log_ratio,), support(prior))


def prior_potential(prior: Prior) -> Potential:
    """-log p: its minimum is the mode of the prior."""
    return Potential((prior.log_prob,), support(prior))


def value_and_euclidean_grad(
    density: LogDensity, hands: Hands
) -> tuple[Float[Tensor, "*batch"], Float[Tensor, "*batch 3"], Float[Tensor, "*batch 3 3"]]:
    """Value and gradients in R^3 and R^{3x3}, by autograd."""
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


def _chunks(count: int, size: int) -> list[slice]:
    """Slices of `size` rows that cover `count`; one, of no rows, where there are none."""
    return [slice(start, start + size) for start in range(0, max(count, 1), size)]


def _flatten(hands: Hands) -> Hands:
    return Hands(hands.position.reshape(-1, 3), hands.rotation.reshape(-1, 3, 3), hands.grasp_type.reshape(-1))
