"""What a grasp must keep to, apart from being clear of what the camera measured.

A hand keeps the constraints if its grasp type is allowed and the open hand, at h and all along the straight approach to
it, is nowhere lower than a height and enters none of the boxes to stay out of. The open hand is taken as the boxes that
cover its shapes; what such a box sweeps on a straight line is a zonotope, so the test is exact for them
(`geometry.zonotope`). Constraints are in the world frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float64
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.box import Box
from bayesgrasp.geometry.grasp_space import carried
from bayesgrasp.geometry.zonotope import meet
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.types import GraspType, Hands

EVERY_TYPE = tuple(GraspType)


@dataclass(frozen=True)
class Constraints:
    """What a grasp must keep to; by default nothing.

    Attributes:
        keep_out: Boxes that the open hand must not enter: axis-aligned, world frame, metres.
        lowest: No part of the open hand may be lower than this, metres above the table; None for no limit.
        grasp_types: The allowed ones.
        confidence: Only grasps that promise so much that they were found to succeed at least at this rate on objects
            that no training had met (`ratio.delivery`); None for the planner's own least promise.

    Raises:
        InvalidConfigurationError: Not a box, a height that is not finite, no, a repeated or an unknown grasp type, or a
            confidence that is not between 0 and 1.
    """

    keep_out: tuple[Box, ...] = ()
    lowest: float | None = None
    grasp_types: tuple[GraspType, ...] = EVERY_TYPE
    confidence: float | None = None

    def __post_init__(self) -> None:
        if not all(isinstance(box, Box) for box in self.keep_out):
            raise InvalidConfigurationError(f"keep_out holds boxes, Box(low, high), got {self.keep_out}")
        if self.lowest is not None and not math.isfinite(self.lowest):
            raise InvalidConfigurationError(f"lowest must be a height in metres, got {self.lowest}")
        if self.confidence is not None and not 0 < self.confidence < 1:
            raise InvalidConfigurationError(f"confidence must be between 0 and 1, got {self.confidence}")
        types = set(self.grasp_types)
        if not types or len(types) < len(self.grasp_types) or not types <= set(EVERY_TYPE):
            known = ", ".join(f"GraspType.{kind.name}" for kind in EVERY_TYPE)
            raise InvalidConfigurationError(f"grasp_types are one or more out of {known}; got {self.grasp_types}")
        object.__setattr__(self, "grasp_types", tuple(GraspType(kind) for kind in self.grasp_types))

    @property
    def any(self) -> bool:
        """Whether anything is asked for."""
        return self.limits_hands or self.confidence is not None

    @property
    def limits_hands(self) -> bool:
        """Whether any hand is forbidden, whatever the image."""
        return bool(self.keep_out) or self.lowest is not None or len(self.grasp_types) < len(EVERY_TYPE)

    def to_dict(self) -> dict[str, Any]:
        """As plain data; metres."""
        return {
            "keep_out": [{"low": list(box.low), "high": list(box.high)} for box in self.keep_out],
            "lowest": self.lowest,
            "grasp_types": [kind.name.lower() for kind in self.grasp_types],
            "confidence": self.confidence,
        }


UNCONSTRAINED = Constraints()


class ConstraintCheck:
    """Tells which hands keep the constraints.

    Args:
        constraints: What they must keep to.
        hand: The open hand.
        standoff: Length of the straight approach, metres.
        workspace_to_world: Frame of the hands that are asked about.
    """

    def __init__(
        self, constraints: Constraints, hand: OpenHand, standoff: float, workspace_to_world: Float64[np.ndarray, "4 4"]
    ) -> None:
        self.constraints, self.hand, self.standoff = constraints, hand, standoff
        self.workspace_to_world = workspace_to_world

    def allows(self, hands: Hands) -> Bool[Tensor, "n"]:
        """Whether each hand keeps all constraints, on the device of the hands."""
        broken = np.stack(list(self.broken(hands).values()))
        return torch.from_numpy(~broken.any(0)).to(hands.position.device)

    def why_none(self, hands: Hands) -> str:
        """In words, why none of many draws from the prior can be taken."""
        counts = {cause: int(rows.sum()) for cause, rows in self.broken(hands).items()}
        causes = ", ".join(f"{count} {cause}" for cause, count in counts.items() if count)
        return f"no hand keeps the constraints: of {len(hands.grasp_type)} draws from the prior {causes}"

    def broken(self, hands: Hands) -> dict[str, Bool[np.ndarray, "n"]]:
        """Which hands break a constraint, by the constraint in words."""
        there = carried(hands.to("cpu", torch.float64), self.workspace_to_world)
        pose = there.position.numpy(), there.rotation.numpy()
        types = there.grasp_type.numpy()
        low, inside = np.zeros(len(types), dtype=bool), np.zeros(len(types), dtype=bool)
        for kind in set(types.tolist()):
            rows = types == kind
            swept = self._swept(GraspType(kind), pose[0][rows], pose[1][rows])
            low[rows], inside[rows] = self._too_low(*swept), self._enters(*swept)
        return {
            "of a grasp type that is not allowed": ~np.isin(types, self.constraints.grasp_types),
            f"lower than {self.constraints.lowest} m": low,
            "in a box to stay out of": inside,
        }

    def _swept(
        self, kind: GraspType, position: Float64[np.ndarray, "n 3"], rotation: Float64[np.ndarray, "n 3 3"]
    ) -> tuple[Float64[np.ndarray, "n shapes 3"], Float64[np.ndarray, "n shapes 4 3"]]:
        """Centres and generators of what the covering boxes of the open hand sweep on the approach, world frame."""
        centers, axes = self.hand.covering_boxes[kind]
        back = np.array([-0.5 * self.standoff, 0.0, 0.0])  # the hand comes along its x axis
        generators = np.concatenate([axes, np.broadcast_to(back, (len(axes), 1, 3))], axis=1)
        turn = np.swapaxes(rotation, 1, 2)
        return (centers + back) @ turn + position[:, None], generators @ turn[:, None]

    def _too_low(
        self, center: Float64[np.ndarray, "n shapes 3"], generators: Float64[np.ndarray, "n shapes 4 3"]
    ) -> Bool[np.ndarray, "n"]:
        if self.constraints.lowest is None:
            return np.zeros(len(center), dtype=bool)
        lowest = center[..., 2] - np.abs(generators[..., 2]).sum(-1)
        below: np.ndarray = lowest.min(-1) < self.constraints.lowest
        return below

    def _enters(
        self, center: Float64[np.ndarray, "n shapes 3"], generators: Float64[np.ndarray, "n shapes 4 3"]
    ) -> Bool[np.ndarray, "n"]:
        inside = np.zeros(len(center), dtype=bool)
        for box in self.constraints.keep_out:
            low, high = np.array(box.low), np.array(box.high)
            inside |= meet(center, generators, (low + high) / 2, np.diag(high - low) / 2).any(-1)
        return inside
