r"""The harder criterion: after the lift, does the grasp hold the object against pushes from six sides?

A force of ``acceleration`` times the object's mass acts at its centre of mass along +x, -x, +y, -y, +z and -z of the
hand frame in turn, gravity going on, while the motors keep their torque. The grasp holds if all along the object has
moved by less than ``largest_shift`` and turned by less than ``largest_turn`` in the hand since before the first push.

Why the hand's axes and not the world's: whether a grasp holds is then the same when hand and object are turned together
about the vertical, as the outcome of the lift is, so the planar refresh (`bayesgrasp.prior.planar_symmetry`) leaves
this label's posterior exactly invariant, too. The six directions are also those in which a hand differs: out of the
palm, along the closing fingers, and sideways between them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.lift.rig import Rig

DIRECTIONS = np.array([sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)])
"""Of the pushes, in the hand frame."""


@dataclass(frozen=True)
class HoldConfig:
    """The pushes, and how far the object may move.

    Attributes:
        acceleration: Force divided by the object's mass, m/s^2.
        push_time: Seconds of each push.
        largest_shift: Metres, of the centre of mass in the hand frame.
        largest_turn: Radians, in the hand frame.
    """

    acceleration: float = 10.0
    push_time: float = 0.3
    largest_shift: float = 0.05
    largest_turn: float = math.radians(15.0)

    def __post_init__(self) -> None:
        if self.acceleration < 0 or self.push_time <= 0:
            raise InvalidConfigurationError(
                f"pushes need an acceleration of at least 0 and a time above 0, got {self.acceleration} m/s^2 "
                f"for {self.push_time} s"
            )
        if self.largest_shift <= 0 or not 0 < self.largest_turn <= math.pi:
            raise InvalidConfigurationError(
                f"largest_shift must be above 0 and largest_turn in (0, pi], got {self.largest_shift} m "
                f"and {self.largest_turn} rad"
            )


def holds(rig: Rig, config: HoldConfig, tick: Callable[[], object], period: float) -> bool:
    """Push the object of a lifted grasp from six sides; ends early once it has moved too far.

    Args:
        rig: After a successful lift, its engine still running.
        config: The pushes.
        tick: Advances the rig by one control period.
        period: Of the control, seconds.
    """
    start = rig.object_in_hand()
    for direction in DIRECTIONS:
        for _ in range(max(1, round(config.push_time / period))):
            rig.push(config.acceleration * direction)
            tick()
            if _moved_too_far(start, rig.object_in_hand(), config):
                return False
    return True


def _moved_too_far(start: Float64[np.ndarray, "4 4"], now: Float64[np.ndarray, "4 4"], config: HoldConfig) -> bool:
    shift = float(np.linalg.norm(now[:3, 3] - start[:3, 3]))
    # The trace of a rotation by an angle is 1 + 2 cos(angle); rounding may take it out of the cosine's range.
    cosine = 0.5 * (float(np.trace(start[:3, :3].T @ now[:3, :3])) - 1.0)
    return shift >= config.largest_shift or math.acos(min(max(cosine, -1.0), 1.0)) >= config.largest_turn
