"""The lift test of the analytic problem: closed-form success probabilities, their means under the prior, exact draws.

For a hand h = (x, R, g) and a bar at one of finitely many poses o = (x_o, y_o, yaw_o),

    p(S=1 | h, o) = w_g exp(-|(x - c_og) / s|^2 / 2) k_o(R),
    k_o(R) = sum_j exp(a (c_j^2 - 1)) / (1 + exp(-a)) <= 1,    c_j^2 = (1 + trace(R_oj^T R)) / 4,   j = 1, 2,

where c_og is above the bar at a height that depends on the type, and R_o1, R_o2 point down and close across the bar,
from either side. Z_o = E_{p(h)} p(S=1 | h, o) is a product of Gaussian integrals over the prior's box and of one
integral over SO(3), by a quadrature that is exact to rounding for the paper's prior.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64, Int64
from scipy.special import ndtr, ndtri
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.geometry.quadrature import rotation_quadrature
from bayesgrasp.types import GraspType, Hands

QUADRATURE_NODES = 48
PROPOSALS = 8
"""Rotations tried for each one that is wanted, per round: about as many as it takes to accept one."""

Triple = tuple[float, float, float]


@runtime_checkable
class HandPrior(Protocol):
    """A prior of hands with independent parts: position uniform in a box, rotation, type (all three possible)."""

    @property
    def low(self) -> Triple:
        """Lower corner of the box, metres."""
        ...

    @property
    def high(self) -> Triple:
        """Upper corner of the box, metres."""
        ...

    def sample(self, n: int, rng: np.random.Generator) -> Hands:
        """Draw n hands, float32."""
        ...

    def log_prob(self, hands: Hands) -> Tensor:
        """Log density."""
        ...


@dataclass(frozen=True)
class BarGraspConfig:
    """Where, how and with which fingers the bar can be grasped.

    Attributes:
        deviation: s, metres, for x, y, z.
        sharpness: a, how exactly the rotation must fit.
        weight: w_g, the best success probability of each type.
        height: Height of the best position of each type, metres.

    Raises:
        InvalidConfigurationError: A deviation or the sharpness is not positive, or a weight outside (0, 1].
    """

    deviation: Triple = (0.04, 0.04, 0.05)
    sharpness: float = 8.0
    weight: Triple = (0.9, 0.6, 0.3)
    height: Triple = (0.20, 0.23, 0.26)

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) and v > 0 for v in (*self.deviation, self.sharpness)):
            raise InvalidConfigurationError("deviation and sharpness must be finite and > 0")
        if not all(0 < w <= 1 for w in self.weight):
            raise InvalidConfigurationError(f"weight must be probabilities in (0, 1], got {self.weight}")
        if not all(math.isfinite(v) for v in self.height):
            raise InvalidConfigurationError(f"height must be finite, metres, got {self.height}")


class BarGrasp:
    """The lift test for one prior and one set of poses.

    Args:
        prior: p(h); its rotation density must be smooth (a polynomial of degree up to about 30 in R is exact).
        poses: Object poses (x, y, yaw), metres and radians, shape (K, 3).
        config: The rest.

    Raises:
        InvalidConfigurationError: The prior excludes a grasp type.
    """

    def __init__(self, prior: HandPrior, poses: Float64[np.ndarray, "K 3"], config: BarGraspConfig) -> None:
        self.prior, self.poses, self.config = prior, poses, config
        yaws, self._turn = np.unique(poses[:, 2], return_inverse=True)
        self._targets = _grasp_rotations(torch.from_numpy(yaws))
        if not self._log_type_probability.isfinite().all():
            raise InvalidConfigurationError("the analytic problem needs a prior in which every grasp type is possible")

    def log_success(self, hands: Hands) -> Float[Tensor, "*batch K"]:
        """Logarithm of p(S=1 | h, o) for every object pose; differentiable in position and rotation."""
        c, like = self.config, hands.position
        poses, deviation = like.new_tensor(self.poses), like.new_tensor(c.deviation)
        across = (like[..., None, :2] - poses[:, :2]) / deviation[:2]
        above = (like[..., 2] - like.new_tensor(c.height)[hands.grasp_type]) / deviation[2]
        of_hand = like.new_tensor(c.weight)[hands.grasp_type].log() - 0.5 * above.square()
        turn = torch.as_tensor(self._turn, device=like.device)
        return of_hand[..., None] - 0.5 * across.square().sum(-1) + self._log_fit(hands.rotation)[..., turn]

    @cached_property
    def log_evidence(self) -> Float64[Tensor, "K"]:
        """Logarithm of Z_o for every object pose."""
        # Given o, the factors of x, y, (z and g) and R are independent under the prior, so their means multiply.
        on_table = self._box_mean(0, self.poses[:, 0]) * self._box_mean(1, self.poses[:, 1])
        return torch.from_numpy(np.log(on_table * self._fit_means[self._turn] * self._type_evidence.sum()))

    def sample_hands(self, index: Int64[np.ndarray, "n"], rng: np.random.Generator) -> Hands:
        """Exact draws from p(h | S=1, o), one hand for each index of a pose; float32."""
        types = rng.choice(len(GraspType), size=len(index), p=self._type_evidence / self._type_evidence.sum())
        centre = np.column_stack([self.poses[index, :2], np.array(self.config.height)[types]])
        position = _truncated_normal(centre, self.config.deviation, self.prior.low, self.prior.high, rng)
        return Hands(torch.from_numpy(position), self._sample_rotation(self._turn[index], rng), torch.from_numpy(types))

    def _sample_rotation(self, turn: Int64[np.ndarray, "n"], rng: np.random.Generator) -> Float32[Tensor, "n 3 3"]:
        """Draws from p(R) k_o(R) / E k_o by rejection: the prior proposes, k_o <= 1 accepts, the first one counts."""
        result = torch.empty(len(turn), 3, 3)
        waiting = np.arange(len(turn))
        while len(waiting):
            proposal = self.prior.sample(PROPOSALS * len(waiting), rng).rotation.unflatten(0, (-1, PROPOSALS))
            fit = self._log_fit(proposal)[np.arange(len(waiting)), :, turn[waiting]].exp().numpy()
            accept = rng.random(fit.shape) < fit
            done = accept.any(1)  # the first accepted one; taking the best would favour fitting rotations
            result[waiting[done]] = proposal[done, accept.argmax(1)[done]]
            waiting = waiting[~done]
        return result

    def _log_fit(self, rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch turns"]:
        """Logarithm of k_o(R), for every yaw."""
        a = self.config.sharpness
        # c_j^2 = cos^2 of half the angle between R and R_oj: trace(R_oj^T R) is the sum of products of all entries.
        squared = (1 + torch.einsum("jtkl,...kl->...jt", self._targets.to(rotation), rotation)) / 4
        # Where R = R_o1, R_o2 is half a turn away (c_2 = 0): the sum is 1 + exp(-a) there, and nowhere more.
        return torch.logsumexp(a * (squared - 1), -2) - math.log1p(math.exp(-a))

    def _box_mean(self, axis: int, centre: Float64[np.ndarray, "m"]) -> Float64[np.ndarray, "m"]:
        """Mean over one side of the prior's box of the Gaussian factor about each centre."""
        low, high, s = self.prior.low[axis], self.prior.high[axis], self.config.deviation[axis]
        # The integral of exp(-((x - c) / s)^2 / 2) over [low, high], divided by its length.
        return (ndtr((high - centre) / s) - ndtr((low - centre) / s)) * s * math.sqrt(2 * math.pi) / (high - low)

    @cached_property
    def _fit_means(self) -> Float64[np.ndarray, "turns"]:
        """Mean of k_o over the prior's rotations, for every yaw."""
        rotation, weight = rotation_quadrature(QUADRATURE_NODES)
        # At a fixed position and type the prior is the rotation's density times a constant, which cancels.
        log_density = self._prior_at_centre(rotation, torch.zeros(len(rotation), dtype=torch.int64))
        density = weight * (log_density - log_density.max()).exp()
        return ((density[:, None] * self._log_fit(rotation).exp()).sum(0) / density.sum()).numpy()

    @cached_property
    def _type_evidence(self) -> Float64[np.ndarray, "3"]:
        """p(g) w_g times the integral over the height, for every type."""
        prior = self._log_type_probability.exp().numpy()
        success: Float64[np.ndarray, "3"] = (
            prior * np.array(self.config.weight) * self._box_mean(2, np.array(self.config.height))
        )
        return success

    @cached_property
    def _log_type_probability(self) -> Float64[Tensor, "3"]:
        down = self._targets[0, :1].expand(len(GraspType), 3, 3)
        return torch.log_softmax(self._prior_at_centre(down, torch.arange(len(GraspType))), 0)

    def _prior_at_centre(self, rotation: Float64[Tensor, "m 3 3"], types: Tensor) -> Float64[Tensor, "m"]:
        centre = (rotation.new_tensor(self.prior.low) + rotation.new_tensor(self.prior.high)) / 2
        return self.prior.log_prob(Hands(centre.expand(len(rotation), 3), rotation, types))


def _grasp_rotations(yaws: Float64[Tensor, "turns"]) -> Float64[Tensor, "2 turns 3 3"]:
    """The two best rotations for bars that lie along each yaw."""
    down = torch.tensor([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]], dtype=torch.float64)
    vertical = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    return so3.exp(torch.stack([yaws, yaws + math.pi])[..., None] * vertical) @ down


def _truncated_normal(
    centre: Float64[np.ndarray, "n 3"], deviation: Triple, low: Triple, high: Triple, rng: np.random.Generator
) -> Float32[np.ndarray, "n 3"]:
    """Gaussian draws within a box, by inverting the distribution function."""
    below, above = (ndtr((np.array(corner) - centre) / deviation) for corner in (low, high))
    # A uniform number between the values of the distribution function at the corners, through its inverse.
    draws = centre + deviation * ndtri(below + (above - below) * rng.random(centre.shape))
    inside: np.ndarray = np.clip(draws.astype(np.float32), np.array(low, np.float32), np.array(high, np.float32))
    return inside
