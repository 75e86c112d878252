"""MAP by Riemannian conjugate gradients on R^3 x SO(3), all starts and all grasp types at once (paper, Algorithm 2).

Per start, in orthonormal coordinates u = (v / l, w) of the tangent space (see `geometry.grasp_space`):

    d_k = -g_k + beta_k d_{k-1},   beta_k = max(0, <g_k, g_k - g_{k-1}> / <d_{k-1}, g_k - g_{k-1}>)   (Hestenes-Stiefel)
    h_{k+1} = (clip(x + a l d_x), R exp([a d_w]_x)),   a by backtracking (Armijo) with quadratic interpolation

Vectors are transported by left translation, which is an isometry and, in these coordinates, the identity. The prior's
box is kept exactly: a trial position is clipped to it, the decrease is judged along the displacement that was really
made, and a coordinate that sits on a face and wants to leave is frozen (active set): a MAP outside the support is
impossible.

A batch is one tensor program: every start has its own step length and stopping reason, and none waits for another: in
each evaluation some try the first step along a new direction and others a shorter one along their last. Those that
stopped are left out.
"""

from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.grasp_space import GraspSpace
from bayesgrasp.posterior.potential import Potential, Prior
from bayesgrasp.types import GraspType, Hands


class Stop(IntEnum):
    """Why a start stopped."""

    MAX_STEPS = 0
    SMALL_GRADIENT = 1
    SMALL_DECREASE = 2
    NO_DECREASE = 3
    OUTSIDE = 4


@dataclass(frozen=True)
class AscentConfig:
    """How to search for the MAP; the defaults are those of Algorithm 2 (20 steps, one start per type).

    Attributes:
        starts_per_type: Ascents per grasp type, see `starting_points`.
        steps: Largest number of conjugate-gradient steps.
        space: The metric.
        first_step: Length of the first trial displacement, radians.
        max_step: Longest displacement in one step, radians.
        armijo: Share of the predicted decrease that a step must reach.
        backtracks: Trials in a line search.
        gradient_tolerance: Stop below this norm of the scaled gradient (nats per radian).
        decrease_tolerance: Stop when a step decreases f by less than this (nats).
    """

    starts_per_type: int = 1
    steps: int = 20
    space: GraspSpace = field(default_factory=GraspSpace)
    first_step: float = 0.1
    max_step: float = 0.5
    armijo: float = 1e-4
    backtracks: int = 12
    gradient_tolerance: float = 1e-4
    decrease_tolerance: float = 1e-5

    def __post_init__(self) -> None:
        for name in ("starts_per_type", "steps", "first_step", "max_step", "backtracks"):
            if not getattr(self, name) > 0:
                raise InvalidConfigurationError(f"{name} must be positive, got {getattr(self, name)}")
        if not 0 < self.armijo < 0.5:
            raise InvalidConfigurationError(f"armijo must be in (0, 0.5), got {self.armijo}")


@dataclass(frozen=True)
class Ascents:
    """Where each start ended.

    Attributes:
        hands: End points.
        value: f there, nats (the negative log-posterior up to a constant).
        steps: Accepted steps.
        stop: `Stop` values.
        evaluations: Hands whose value and gradient were computed, over all starts.
    """

    hands: Hands
    value: Float[Tensor, "n"]
    steps: Int[Tensor, "n"]
    stop: Int[Tensor, "n"]
    evaluations: int

    @property
    def best(self) -> Hands:
        """The end point with the lowest potential (the MAP estimate), of batch shape ()."""
        return self.hands[self.value.argmin()]


def with_every_type(hands: Hands) -> Hands:
    """The same poses under each grasp type: (n,) hands become (3 n,)."""
    n, types = len(hands.grasp_type), torch.arange(len(GraspType), device=hands.grasp_type.device)
    repeat = torch.arange(n, device=types.device).repeat(len(types))
    return Hands(hands.position[repeat], hands.rotation[repeat], types.repeat_interleave(n))


def starting_points(hands: Hands, value: Float[Tensor, "n"], per_type: int = 1) -> Hands:
    """The best hands of each grasp type (Algorithm 2, initial iterates).

    Args:
        hands: Candidates, (n,).
        value: The potential of each.
        per_type: Starts per type. The candidates are dealt into as many parts and the best of each is taken, so the
            best of all is always among them and the others come from elsewhere.

    Returns:
        At most 3 * per_type hands; fewer where a part has no candidate of some type with a finite value.

    Raises:
        InvalidConfigurationError: No candidate has a finite value.
    """
    part = torch.arange(len(value), device=value.device) % per_type
    group = hands.grasp_type * per_type + part
    groups = torch.arange(len(GraspType) * per_type, device=value.device)
    best = torch.where(group == groups[:, None], value, torch.inf).min(-1)
    if not best.values.isfinite().any():
        raise InvalidConfigurationError(f"none of {len(value)} candidates has a finite potential to start from")
    return hands[best.indices[best.values.isfinite()]]


def ascend(potential: Potential, starts: Hands, config: AscentConfig | None = None) -> Ascents:
    """Minimise the potential from each start, with the grasp type fixed.

    Args:
        potential: What is to be minimised.
        starts: Batch shape (n,).
        config: Steps, tolerances and scales.
    """
    descent = _Descent(potential, starts, config or AscentConfig())
    while descent.step():
        pass
    return descent.result()


def find_map(
    potential: Potential,
    prior: Prior,
    rng: np.random.Generator,
    num_draws: int = 1000,
    config: AscentConfig | None = None,
    device: torch.device | str = "cpu",
) -> Ascents:
    """Algorithm 2: draw poses from the prior, ascend from the best of each type; `Ascents.best` is the MAP estimate.

    Args:
        potential: What is to be minimised.
        prior: Where the starts are drawn from.
        rng: Source of the draws.
        num_draws: Draws of (x, R); each is tried with every type.
        config: Steps, tolerances and scales; by default the paper's.
        device: Where the potential takes hands.
    """
    config = config or AscentConfig()
    candidates = with_every_type(prior.sample(num_draws, rng).to(device))
    return ascend(potential, starting_points(candidates, potential.value(candidates), config.starts_per_type), config)


class _Descent:
    """State of a batch of conjugate-gradient descents; tensors of n rows, in the coordinates u = (v / l, w)."""

    def __init__(self, potential: Potential, starts: Hands, config: AscentConfig):
        self.potential, self.config = potential, config
        self.hands = Hands(starts.position.clone(), starts.rotation.clone(), starts.grasp_type)
        self.scale = config.space.per_radian(starts.position)
        self.low, self.high = potential.box.corners(starts.position)
        value, gradient = potential.value_and_grad(starts)
        self.value, self.gradient = value, gradient * self.scale
        self.direction = torch.zeros_like(self.gradient)
        self.previous = torch.zeros_like(self.gradient)
        self.step_length, self.curvature = torch.full_like(value, config.first_step), torch.zeros_like(value)
        self.slope, self.factor = torch.zeros_like(value), torch.zeros_like(value)
        count = torch.zeros_like(starts.grasp_type)
        self.steps, self.searches, self.trials = count.clone(), count.clone(), count
        self.stop = torch.full_like(starts.grasp_type, Stop.MAX_STEPS)
        self.active = value.isfinite()
        self.stop[~self.active] = Stop.OUTSIDE
        self.due, self.steepest = self.active.clone(), self.active.clone()
        self.evaluations = len(value)

    def step(self) -> bool:
        """One trial of every start that is still going, along a new direction where one is due; False when none is."""
        self._aim()
        rows = self.active.nonzero()[:, 0]
        if len(rows) == 0:
            return False
        before = self.value[rows]
        accepted, excess = self._try(rows)
        self._shorten(rows[~accepted], excess[~accepted])
        moved = rows[accepted]
        self.steps[moved] += 1
        self.due[moved] = True
        small = before[accepted] - self.value[moved] < self.config.decrease_tolerance
        self._finish(moved[small], Stop.SMALL_DECREASE)
        return True

    def result(self) -> Ascents:
        return Ascents(self.hands, self.value, self.steps, self.stop, self.evaluations)

    def _aim(self) -> None:
        """Directions and first trials of the starts that are due, or their end."""
        free_gradient = torch.where(self._blocked(), 0.0, self.gradient)
        flat = self.due & self.active & (free_gradient.norm(dim=-1) < self.config.gradient_tolerance)
        self._finish(flat, Stop.SMALL_GRADIENT)
        self.active &= ~(self.due & (self.searches == self.config.steps))
        due = self.due & self.active
        self._turn(free_gradient, due)
        self.slope = torch.where(due, (self.direction * free_gradient).sum(-1), self.slope)
        self.factor = torch.where(due, self._first_trial(self.slope), self.factor)
        self.searches += due
        self.trials[due] = 0
        self.due = torch.zeros_like(due)

    def _blocked(self) -> Bool[Tensor, "n 6"]:
        """Coordinates on a face of the box whose descent points outwards."""
        x, g = self.hands.position, self.gradient[:, :3]
        outwards = ((x <= self.low) & (g > 0)) | ((x >= self.high) & (g < 0))
        return torch.cat([outwards, torch.zeros_like(outwards)], -1)

    def _turn(self, gradient: Float[Tensor, "n 6"], due: Bool[Tensor, "n"]) -> None:
        """Set the next direction where one is due, and note where it is that of steepest descent."""
        change = gradient - self.previous
        curvature = (self.direction * change).sum(-1)
        beta = ((gradient * change).sum(-1) / curvature).nan_to_num(0.0, 0.0, 0.0).clamp(min=0.0)
        direction = torch.where(gradient == 0, 0.0, beta[:, None] * self.direction) - gradient
        ascending = (direction * gradient).sum(-1) > -0.1 * direction.norm(dim=-1) * gradient.norm(dim=-1)
        steepest = ascending | (beta == 0)
        direction = torch.where(steepest[:, None], -gradient, direction)
        self.steepest = torch.where(due, steepest, self.steepest)
        self.direction = torch.where(due[:, None], direction, self.direction)
        self.previous = torch.where(due[:, None], gradient, self.previous)

    def _first_trial(self, slope: Float[Tensor, "n"]) -> Float[Tensor, "n"]:
        """Newton's step for the curvature seen along the last direction, within a range around the last step."""
        length = self.direction.norm(dim=-1).clamp(min=torch.finfo(slope.dtype).tiny)
        newton = torch.where(self.curvature > 0, -slope / length / self.curvature, torch.inf)
        step = torch.minimum(torch.maximum(newton, 0.2 * self.step_length), 4.0 * self.step_length)
        lengths: Float[Tensor, "n"] = step.clamp(max=self.config.max_step) / length
        return lengths

    def _try(self, rows: Int[Tensor, "m"]) -> tuple[Bool[Tensor, "m"], Float[Tensor, "m"]]:
        """Evaluate one trial per row and keep those that decrease enough; which they are, and f(trial) - f for all."""
        direction, factor = self.direction[rows], self.factor[rows]
        trial, shift = self._displace(rows, factor[:, None] * direction)
        value, gradient = self.potential.of(rows).value_and_grad(trial)
        gradient = gradient * self.scale
        self.evaluations += len(rows)
        excess, predicted = value - self.value[rows], (self.gradient[rows] * shift).sum(-1)
        accepted = (excess <= self.config.armijo * predicted) & (predicted < 0)
        keep, length = rows[accepted], direction.norm(dim=-1)
        curvature = ((gradient * direction).sum(-1) - self.slope[rows]) / (factor * length**2)
        for state, new in (
            (self.hands.position, trial.position),
            (self.hands.rotation, trial.rotation),
            (self.value, value),
            (self.gradient, gradient),
            (self.step_length, factor * length),
            (self.curvature, curvature),
        ):
            state[keep] = new[accepted]
        return accepted, excess

    def _shorten(self, rows: Int[Tensor, "m"], excess: Float[Tensor, "m"]) -> None:
        """Next trials of rows whose last one failed; where it was the last in its line search, a new direction."""
        # Minimum of the parabola through f(0), f'(0) and f(a); a bounded share of a, however bad the trial was.
        predicted = self.slope[rows] * self.factor[rows]
        parabola = -0.5 * predicted / (excess - predicted)
        self.factor[rows] *= parabola.nan_to_num(0.0).clamp(0.1, 0.5)
        self.trials[rows] += 1
        failed = rows[self.trials[rows] == self.config.backtracks]
        self._finish(failed[self.steepest[failed]], Stop.NO_DECREASE)
        self.direction[failed] = 0.0  # the next direction is the steepest one
        self.due[failed] = True

    def _displace(self, rows: Int[Tensor, "m"], shift: Float[Tensor, "m 6"]) -> tuple[Hands, Float[Tensor, "m 6"]]:
        """Retract, with positions clipped to the box; also the scaled displacement that was really made."""
        start = self.hands[rows]
        trial = self.config.space.retract(start, shift * self.scale)
        trial = replace(trial, position=self.potential.box.clip(trial.position))
        return trial, torch.cat([(trial.position - start.position) / self.scale[:3], shift[:, 3:]], -1)

    def _finish(self, which: Bool[Tensor, "n"] | Int[Tensor, "m"], reason: Stop) -> None:
        self.stop[which] = reason
        self.active[which] = False
