"""Which hands the robot can execute, and in which order it should try them.

A robot wants the grasp that most probably succeeds. The mode of p(h | S=1, i) need not be it: where p(S=1 | i, h) is
near 1 for many hands, the prior decides among them, and draws the mode towards its own. So grasps are ranked by
p(S=1 | i, h), averaged over hands a little beside: a maximum that is narrower than any robot is exact is more often
the network's error than the object's (`search`). Averages that hardly differ are a tie, which the posterior breaks. A
grasp is executable if it is clear of the measured surface and of the table and within the arm's reach. One that the
model itself thinks is more likely to fail than to succeed is no grasp to execute.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, Protocol, get_args, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.grasp_space import GraspSpace
from bayesgrasp.planning.observing import Observed, Pose
from bayesgrasp.planning.plan import Grasp
from bayesgrasp.robot.motion import Motion, MotionConfig
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.types import GraspType, Hands

Rank = Literal["success", "held", "posterior"]
"""What makes one grasp better than another."""
MOST_POINTS = 800
"""More measured points than this are thinned."""


@runtime_checkable
class Arm(Protocol):
    """What brings the hand to a pose."""

    def plan(self, hand_to_world: Pose, grasp_type: GraspType) -> Motion | None:
        """A collision-free motion, or None."""
        ...


@dataclass(frozen=True)
class Robot:
    """What executes a grasp.

    Attributes:
        hand: The open hand.
        arm: The arm.
    """

    hand: OpenHand
    arm: Arm


@dataclass(frozen=True)
class SelectionConfig:
    """What makes a grasp executable and distinct, and which is better.

    Attributes:
        rank: By estimated success probability on average over hands a little beside, or by that of holding against
            pushes, ties broken by the log posterior; or by the log posterior alone.
        tie: Probabilities that differ by no more than this are a tie.
        least_success: Grasps of a lower success probability are refused; an unknown one is not.
        distinct: Grasps closer than this are one grasp, radians in the metric `space`.
        penetration: The open hand may cut this far into the measured surface (its noise), metres.
        cutting_points: From so many measured points deeper than that on, a hand collides.
        standoff: The straight approach is as long as this, metres; the open hand must be clear all along.
        space: The metric.
    """

    rank: Rank = "success"
    tie: float = 0.001
    least_success: float = 0.5
    distinct: float = 0.2
    penetration: float = 0.003
    cutting_points: int = 2
    standoff: float = MotionConfig.standoff
    space: GraspSpace = field(default_factory=GraspSpace)

    def __post_init__(self) -> None:
        if self.rank not in get_args(Rank):
            raise InvalidConfigurationError(f"grasps are ranked by {', '.join(get_args(Rank))}, not by {self.rank!r}")
        if min(self.tie, self.distinct, self.penetration, self.standoff) < 0 or self.cutting_points < 1:
            raise InvalidConfigurationError(
                "need tie, distinct, penetration and standoff >= 0, and cutting_points >= 1"
            )
        if not 0 <= self.least_success <= 1:
            raise InvalidConfigurationError(f"least_success is a probability, got {self.least_success}")


@dataclass(frozen=True)
class Candidates:
    """Hands to choose from.

    Attributes:
        hands: In the workspace frame.
        log_posterior: log p(h | S=1, i) of each, nats.
        probability: Estimate of p(S=1 | i, h) of each.
        held: Estimate of p(held | i, h) of each; None where the model does not know.
        steady: Mean of p(S=1 | i, h) over each hand and some a little beside it; None where that is not known.
    """

    hands: Hands
    log_posterior: Float[Tensor, "n"]
    probability: Float[Tensor, "n"]
    held: Float[Tensor, "n"] | None = None
    steady: Float[Tensor, "n"] | None = None

    def ranked(self, config: SelectionConfig) -> list[int]:
        """Indices of the hands, best first; what is not a number counts as the worst."""
        by_posterior = self.log_posterior.nan_to_num(nan=-torch.inf).argsort(descending=True)
        if config.rank == "posterior":
            return list(by_posterior.tolist())
        by = self.probability if self.steady is None else self.steady
        if config.rank == "held" and self.held is not None:
            by = self.held
        level = _levels(by, config.tie)[by_posterior]
        return list(by_posterior[level.argsort(stable=True)].tolist())


class Selection:
    """Picks the candidates that the robot can execute.

    Args:
        robot: The hand and the arm.
        observed: Measured points, the user's camera, and the frame of the candidates.
        config: What makes a grasp executable and distinct.
    """

    def __init__(self, robot: Robot, observed: Observed, config: SelectionConfig) -> None:
        self.robot, self.config = robot, config
        self.world_to_camera = np.linalg.inv(observed.camera_to_world)
        self.workspace_to_world = observed.workspace_to_world
        surface = observed.surface
        raised = surface.raised_points()
        self.raised = raised[:: 1 + len(raised) // MOST_POINTS]
        self.item = surface.item_points.astype(np.float64)[:: 1 + int(surface.item.sum()) // MOST_POINTS]
        self.failures = {"the arm does not reach it": 0, "the open hand would cut into the object or the table": 0}

    def select(self, candidates: Candidates, top: int) -> tuple[tuple[Grasp, ...], str | None]:
        """The best `top` distinct candidates that may be executed and can be, or the reason why there is none."""
        likely = ~(candidates.probability < self.config.least_success)
        if not likely.any():
            return (), self._unlikely(candidates)
        grasps: list[Grasp] = []
        tried: list[int] = []
        for index in candidates.ranked(self.config):
            if len(grasps) == top:
                break
            if not likely[index] or self._repeats(candidates.hands, tried, index):
                continue
            tried.append(index)
            grasp = self._check(candidates, index)
            if grasp is not None:
                grasps.append(grasp)
        return tuple(grasps), None if grasps else self._reason(len(tried), int((~likely).sum()))

    def _unlikely(self, candidates: Candidates) -> str:
        best = float(candidates.probability.nan_to_num(nan=0.0).max())
        return (
            f"not likely enough: the best grasp has an estimated success of {100 * best:.0f} %, at least "
            f"{100 * self.config.least_success:.4g} % is asked for"
        )

    def _repeats(self, hands: Hands, tried: list[int], index: int) -> bool:
        if not tried:
            return False
        distance = self.config.space.distance(hands[index : index + 1], hands[hands.grasp_type.new_tensor(tried)])
        return bool((distance < self.config.distinct).any())

    def _check(self, candidates: Candidates, index: int) -> Grasp | None:
        hands = candidates.hands
        grasp_type = GraspType(int(hands.grasp_type[index]))
        hand_to_workspace = np.eye(4)
        hand_to_workspace[:3, :3], hand_to_workspace[:3, 3] = (
            hands.rotation[index].numpy(),
            hands.position[index].numpy(),
        )
        clearance = self._clearance(hand_to_workspace, grasp_type)
        if clearance is None:
            self.failures["the open hand would cut into the object or the table"] += 1
            return None
        hand_to_world = self.workspace_to_world @ hand_to_workspace
        motion = self.robot.arm.plan(hand_to_world, grasp_type)
        if motion is None:
            self.failures["the arm does not reach it"] += 1
            return None
        between = self.robot.hand.between_fingers(_in_hand(self.item, hand_to_workspace))
        return Grasp(
            hand_to_world,
            self.world_to_camera @ hand_to_world,
            grasp_type,
            float(candidates.log_posterior[index]),
            float(candidates.probability[index]),
            float(between.mean()),
            clearance,
            motion,
            math.nan if candidates.held is None else float(candidates.held[index]),
        )

    def _clearance(self, hand_to_workspace: Pose, grasp_type: GraspType) -> float | None:
        """Least distance to the measured surface on the way to h; None where the open hand collides."""
        if self.robot.hand.lowest(hand_to_workspace, grasp_type) < -self.config.penetration:
            return None
        if len(self.raised) == 0:
            return np.inf
        points = _in_hand(self.raised, hand_to_workspace)
        clearance = np.inf
        for back in np.linspace(0.0, self.config.standoff, 3):
            distance = self.robot.hand.distance(points + np.array([back, 0.0, 0.0]), grasp_type)
            if (distance < -self.config.penetration).sum() >= self.config.cutting_points:
                return None
            clearance = min(clearance, float(distance.min()))
        return clearance

    def _reason(self, tried: int, unlikely: int) -> str:
        causes = ", ".join(f"{cause} ({count})" for cause, count in self.failures.items() if count)
        others = (
            f"; {unlikely} others have an estimated success below {100 * self.config.least_success:.4g} %"
            if unlikely
            else ""
        )
        return f"unreachable: none of the {tried} best grasps can be executed: {causes}{others}"


def _in_hand(points: np.ndarray, hand_to_workspace: Pose) -> np.ndarray:
    in_hand: np.ndarray = (points - hand_to_workspace[:3, 3]) @ hand_to_workspace[:3, :3]
    return in_hand


def _levels(value: Float[Tensor, "n"], tie: float) -> Int[Tensor, "n"]:
    """0 for the largest value and all within `tie` of it, 1 for the largest of the others and its ties, and so on.

    What is not a number is worse than every number.
    """
    value = value.nan_to_num(nan=-torch.inf)
    level, left = torch.zeros_like(value, dtype=torch.int64), torch.ones_like(value, dtype=torch.bool)
    while left.any():
        group = left & (value >= value[left].max() - tie)
        left &= ~group
        level[left] += 1
    return level
