"""Hamiltonian Monte Carlo on R^3 x SO(3) x G: batched chains that leave p(h | S=1, i) invariant.

The momentum m ~ N(0, I_6) lives in the orthonormal coordinates u = (v / l, w) of the tangent space. With a bi-invariant
metric the free motion is a geodesic at constant m, so a leapfrog step of size e is

    m <- m - e/2 grad f(h),   x <- fold(x + e l m_x),  R <- R exp(e [m_w]_x),   m <- m - e/2 grad f(h),

each part preserves volume and is undone by reversing m: the Metropolis test on H = f + |m|^2 / 2 needs no correction.
At a face of the prior's box a coordinate is reflected together with its momentum (`fold`), which keeps both
properties, so no chain ever leaves the support. One leapfrog step is the Metropolis-adjusted Langevin algorithm.

Between trajectories a symmetric jump proposes another grasp type and, half of the time, a turn by a multiple of pi/2
about the approach axis, which carries one mode of the rotation prior near the next one; it is accepted by the ratio
of densities. Step sizes adapt in the warm-up only.
"""

import math
from dataclasses import dataclass, field

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.geometry.box import Box
from bayesgrasp.geometry.grasp_space import GraspSpace
from bayesgrasp.posterior.potential import Potential
from bayesgrasp.types import GraspType, Hands

QUARTER_TURNS = (0, 0, 0, 0, 1, 2, 2, 3)
"""Turns of a jump, equally likely; as likely as their inverses, so that the proposal is symmetric."""
ADAPTATION_RATE = 1.0
"""Change of the logarithm of the step per unit of excess acceptance, in the warm-up."""


@dataclass(frozen=True)
class ChainConfig:
    """How to run the chains.

    Attributes:
        warmup: Trajectories before the first that is kept; the step size adapts in them.
        leapfrog: Leapfrog steps in a trajectory; 1 is MALA.
        jump_every: A jump follows every so many trajectories.
        step: First step size, radians.
        jitter: Relative half-range of the step size around its value, against periodic orbits.
        target_acceptance: Acceptance that the warm-up steers to.
        space: The metric.
    """

    warmup: int = 10
    leapfrog: int = 1
    jump_every: int = 2
    step: float = 0.2
    jitter: float = 0.3
    target_acceptance: float = 0.65
    space: GraspSpace = field(default_factory=GraspSpace)

    def __post_init__(self) -> None:
        if self.warmup < 0 or self.leapfrog < 1 or self.jump_every < 1 or not self.step > 0:
            raise InvalidConfigurationError("a chain needs warmup >= 0, leapfrog >= 1, jump_every >= 1 and step > 0")
        if not (0 <= self.jitter < 1 and 0 < self.target_acceptance < 1):
            raise InvalidConfigurationError("jitter must be in [0, 1) and target_acceptance in (0, 1)")


@dataclass(frozen=True)
class ChainSample:
    """Draws of the chains and how well they mixed.

    Attributes:
        hands: Draws, (trajectories, chains).
        acceptance: Mean acceptance of the trajectories after the warm-up.
        jump_acceptance: Share of jumps that were taken, over all that proposed a change.
        step: Step size after the warm-up, radians.
    """

    hands: Hands
    acceptance: float
    jump_acceptance: float
    step: float

    def flat(self) -> Hands:
        """All draws as one batch, (trajectories * chains,)."""
        h = self.hands
        return Hands(h.position.reshape(-1, 3), h.rotation.reshape(-1, 3, 3), h.grasp_type.reshape(-1))


def run_chains(
    potential: Potential,
    starts: Hands,
    trajectories: int,
    generator: torch.Generator,
    config: ChainConfig | None = None,
) -> ChainSample:
    """Run one chain from each start.

    Args:
        potential: f = -log density, with its box.
        starts: First states, inside the box, (chains,). Draws by importance resampling make the warm-up short.
        trajectories: Kept draws of each chain.
        generator: Source of randomness.
        config: Steps and adaptation.

    Raises:
        InvalidConfigurationError: A start has no finite density, or there is no trajectory to keep.
    """
    if trajectories < 1:
        raise InvalidConfigurationError(f"at least one trajectory must be kept, got {trajectories}")
    config = config or ChainConfig()
    chains = _Chains(potential, starts, generator, config)
    for index in range(config.warmup):
        acceptance = chains.trajectory()
        if index % config.jump_every == 0:
            chains.jump()
        chains.step_size *= math.exp(ADAPTATION_RATE * (acceptance - config.target_acceptance))
    kept, acceptances, jumps = [], [], []
    for index in range(trajectories):
        acceptances.append(chains.trajectory())
        if index % config.jump_every == 0:
            jumps.append(chains.jump())
        kept.append(chains.hands)
    draws = Hands(*(torch.stack([getattr(h, name) for h in kept]) for name in ("position", "rotation", "grasp_type")))
    return ChainSample(draws, sum(acceptances) / trajectories, sum(jumps) / len(jumps), chains.step_size)


class _Chains:
    """Current states, their potential and its gradient in the coordinates u."""

    def __init__(self, potential: Potential, starts: Hands, generator: torch.Generator, config: ChainConfig):
        self.potential, self.generator, self.config = potential, generator, config
        self.scale = config.space.per_radian(starts.position)
        self.turns = so3.exp(starts.position.new_tensor([[0.5 * math.pi * k, 0.0, 0.0] for k in range(4)]))
        self.step_size = config.step
        self.hands = starts
        self.value, self.gradient = self._evaluate(starts)
        if not self.value.isfinite().all():
            raise InvalidConfigurationError("every chain must start where the density is finite and positive")

    def trajectory(self) -> float:
        """One trajectory of every chain; its mean acceptance."""
        size = self.step_size * (1 + self.config.jitter * (2 * self._uniform()[:, None] - 1))
        momentum = torch.randn(self.gradient.shape, generator=self.generator, device=self.gradient.device)
        momentum = momentum.to(self.gradient)
        hands, gradient = self.hands, self.gradient
        energy = self.value + 0.5 * momentum.square().sum(-1)
        for _ in range(self.config.leapfrog):
            momentum = momentum - 0.5 * size * gradient
            hands, momentum = self._drift(hands, momentum, size)
            value, gradient = self._evaluate(hands)
            momentum = momentum - 0.5 * size * gradient
        excess = value + 0.5 * momentum.square().sum(-1) - energy
        # A trajectory that ran into a non-finite value has no reverse: it is rejected.
        probability = (-excess).exp().nan_to_num(0.0, 1.0).clamp(max=1.0)
        self._move(self._uniform() < probability, hands, value, gradient)
        return float(probability.mean())

    def _drift(
        self, hands: Hands, momentum: Float[Tensor, "n 6"], size: Float[Tensor, "n 1"]
    ) -> tuple[Hands, Float[Tensor, "n 6"]]:
        moved = self.config.space.retract(hands, size * momentum * self.scale)
        position, sign = fold(moved.position, self.potential.box)
        momentum = torch.cat([momentum[:, :3] * sign, momentum[:, 3:]], -1)
        return Hands(position, moved.rotation, hands.grasp_type), momentum

    def jump(self) -> float:
        """One jump of every chain; the share taken of those that propose a change."""
        n, types = len(self.value), len(GraspType)
        device = self.value.device
        draw = torch.randint(len(QUARTER_TURNS), (n,), generator=self.generator, device=device)
        turn = torch.tensor(QUARTER_TURNS, device=device)[draw]
        shift = torch.randint(types, (n,), generator=self.generator, device=device)
        proposal = Hands(
            self.hands.position, self.hands.rotation @ self.turns[turn], (self.hands.grasp_type + shift) % types
        )
        value, gradient = self._evaluate(proposal)
        changed = (turn != 0) | (shift != 0)
        accepted = changed & (self._uniform() < (self.value - value).exp().nan_to_num(0.0))
        self._move(accepted, proposal, value, gradient)
        return float(accepted.sum() / changed.sum().clamp(min=1))

    def _evaluate(self, hands: Hands) -> tuple[Float[Tensor, "n"], Float[Tensor, "n 6"]]:
        value, gradient = self.potential.value_and_grad(hands)
        return value, gradient * self.scale

    def _move(self, where: Bool[Tensor, "n"], hands: Hands, value: Tensor, gradient: Tensor) -> None:
        one, two = where[:, None], where[:, None, None]
        self.hands = Hands(
            torch.where(one, hands.position, self.hands.position),
            torch.where(two, hands.rotation, self.hands.rotation),
            torch.where(where, hands.grasp_type, self.hands.grasp_type),
        )
        self.value = torch.where(where, value, self.value)
        self.gradient = torch.where(one, gradient, self.gradient)

    def _uniform(self) -> Float[Tensor, "n"]:
        shape, like = self.value.shape, self.value
        return torch.rand(shape, generator=self.generator, dtype=like.dtype, device=like.device)


def fold(position: Float[Tensor, "*batch 3"], box: Box) -> tuple[Float[Tensor, "*batch 3"], Float[Tensor, "*batch 3"]]:
    """Reflect positions at the faces of the box, as often as needed.

    Returns:
        Positions inside, and for each coordinate +1 or -1: whether its velocity is reversed.
    """
    low, high = box.corners(position)
    size = high - low
    phase = torch.remainder(position - low, 2 * size)
    back = phase > size
    folded = low + torch.where(back, 2 * size - phase, phase)
    return box.clip(folded), torch.where(back, -1.0, 1.0).to(position)
