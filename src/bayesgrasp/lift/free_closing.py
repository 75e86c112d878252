"""How a hand closes on nothing, control period by control period, and what of it is certainly free of contact.

Physics without contact repeats the free motion, so it is recorded once for each grasp type. A tick is a control
period; state 0 is the open hand and state k the hand after k ticks. Between two ticks no point of the hand moves
farther than the way that is recorded with them, so a few distances from the object say where it cannot be met.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from bayesgrasp.robot.gripper_model import HandState

MARGIN = 0.003
"""Metres that the hand in physics may be away from where geometry has it: soft contacts, servos, a settling object."""


@dataclass(frozen=True)
class Window:
    """Ticks from the first to the last at which the closing hand may touch something; the last may not be found yet."""

    first: int
    last: int


@dataclass(frozen=True)
class FreeClosing:
    """A free closing motion.

    Attributes:
        states: Of the hand, one after each tick.
        way: How far the fastest point of the hand has come until then, metres.
    """

    states: HandState
    way: Float64[np.ndarray, "ticks"]

    def __len__(self) -> int:
        return len(self.way)

    @property
    def angles(self) -> Float64[np.ndarray, "ticks joints"]:
        """Of the joints after each tick, radians."""
        return self.states.angles

    @cached_property
    def near(self) -> float:
        """Metres: farther than this at two ticks in a row, the hand keeps `MARGIN` between them, too."""
        # A point that moves by s between two ticks is within s / 2 of where it is at one of them.
        return MARGIN + 0.5 * float(np.diff(self.way).max(initial=0.0))

    def window(self, clearance: Callable[[int], float]) -> Window | None:
        """When the hand may touch something; None if never.

        From a tick with a clearance of c the hand goes on by c less `MARGIN` without being asked again. At the first
        overlap the search ends, and what comes after it counts as near.

        Args:
            clearance: Distance of the hand from everything after a tick, metres, negative for overlap; a lower bound.
        """
        near: list[int] = []
        tick, end = 0, len(self)
        while tick < end:
            distance = clearance(tick)
            if distance < 0.0:
                return Window(min([*near, tick]), end)
            if distance < self.near:
                near.append(tick)
            tick = max(tick + 1, self._reached(tick, distance - MARGIN))
        return Window(near[0], near[-1]) if near else None

    def _reached(self, tick: int, way: float) -> int:
        """The last tick at which no point has come farther than that since a tick."""
        return int(np.searchsorted(self.way, self.way[tick] + way, side="right")) - 1
