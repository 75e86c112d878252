"""How a hand closes on nothing, control period by control period, and what of it is certainly free of contact.

Physics without contact repeats the free motion, so it is recorded once for each grasp type. A tick is a control
period; state 0 is the open hand and state k the hand after k ticks. Between two ticks no point of the hand moves
farther than the way that is recorded with them, so a few distances from the object say where it cannot be met.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from bayesgrasp.lift.rig import Rig
from bayesgrasp.robot.gripper_model import HandState
from bayesgrasp.robot.physics_scene import ObjectState

MARGIN = 0.003
"""Metres that the hand in physics may be away from where geometry has it: soft contacts, servos, a settling object."""


LEAD = 3
"""Ticks before the first possible contact at which physics begins; an object that stands settles within two."""
LAG = 2
"""Ticks by which the closing hand in physics may be behind the recorded one."""
LOOK = 8
"""Ticks between two looks whether an object that was touched can be touched again: a look costs as much as two."""
AS_RECORDED = 0.01
"""Radians by which the joints of a hand that moves freely differ from the recorded motion, at most."""


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

    def window(self, clearance: Callable[[int], float], since: int = 0) -> Window | None:
        """When the hand may touch something; None if never.

        From a tick with a clearance of c the hand goes on by c less `MARGIN` without being asked again. At the first
        overlap the search ends, and what comes after it counts as near.

        Args:
            clearance: Distance of the hand from everything after a tick, metres, negative for overlap; a lower bound.
            since: The first tick that matters.
        """
        near: list[int] = []
        tick, end = since, len(self)
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


@dataclass(frozen=True)
class FreePart:
    """What of an attempt is certainly free of contact, so that physics need not play it.

    Attributes:
        item: The object, and where it was placed.
        approach: Whether the approach is free.
        closing: The free closing motion of the hand.
        window: Outside of it the closing is free, if nothing was touched before.
        foresee: The window of what is left after a tick, with the object elsewhere and (metres) by so much nearer.
    """

    item: ObjectState
    approach: bool
    closing: FreeClosing
    window: Window | None
    foresee: Callable[[ObjectState, int, float], Window | None]

    @property
    def before(self) -> int:
        """Ticks of the closing that need not be played before something is touched."""
        return 0 if self.window is None else max(0, self.window.first - LEAD)

    def goes_on(self, rig: Rig, tick: int) -> bool:
        """Whether the hand is where the recorded motion has it; the table or the object may have held it up."""
        return rig.hand_shift(self.closing.states[min(tick, len(self.closing) - 1)]) < AS_RECORDED

    def is_passed(self, rig: Rig, tick: int) -> bool:
        """Whether a hand that goes on is past all that it may touch, while the object stands where it stood."""
        last = -1 if self.window is None else self.window.last
        return tick > last + LAG and rig.object_shift(self.item) < MARGIN / 3.0

    def is_lost(self, rig: Rig, tick: int, left: float) -> bool:
        """Whether neither a hand that goes on nor the object comes to where they touch in the seconds that are left."""
        if tick % LOOK or tick >= len(self.closing):
            return False
        there = replace(self.item, pose=rig.data.qpos[rig.object.qpos].copy())
        return self.foresee(there, tick, left * rig.object_speed()) is None
