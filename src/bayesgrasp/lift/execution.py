"""Physics of one attempt: approach, close until contact, lift, hold, decide (section 4.1).

The fingers close at the motors' speed; a motor stops when its tension reaches its torque and goes on if the tension
falls again, and its gear holds what it has reached. What is certainly free of contact need not be played: physics can
begin shortly before the first possible touch, with the arm at h and the hand as the recorded free motion has it. The
success criterion is stated here and nowhere else, see `LiftConfig`; the harder one is `bayesgrasp.lift.hold`. Neither
knows which engine runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.lift.attempt import Attempt
from bayesgrasp.lift.engine import DivergedError
from bayesgrasp.lift.free_closing import FreePart
from bayesgrasp.lift.hold import HoldConfig, holds
from bayesgrasp.lift.rig import Rig
from bayesgrasp.robot.motion import Motion
from bayesgrasp.types import Outcome

Observer = Callable[[mujoco.MjModel, mujoco.MjData], None]
Angles = Float64[np.ndarray, "6"]


@dataclass(frozen=True)
class LiftConfig:
    """Timing of the lift test, and its criterion.

    A grasp succeeds if, after the hand has risen and stood still for ``hold_time``, the object's centre of mass has
    risen by at least ``success_rise`` of the hand's own rise, and if from the start of the lift to the end of the hold
    the object never lost touch with the hand for longer than ``release_time``.

    Attributes:
        approach_time: Seconds from the pre-grasp to h.
        closing_limit: Seconds after which the lift begins even if a motor still moves; it goes on moving then.
        lift_time: Seconds of the rise.
        hold_time: Seconds of standing still after it.
        settle_time: Seconds after closing and before the lift.
        success_rise: Share of the hand's rise, in (0, 1].
        release_time: Seconds.
        control_period: Seconds between updates of set-points and checks.
        largest_speed: Metres per second; an object faster than this means that the simulation diverged.
    """

    approach_time: float = 0.3
    closing_limit: float = 1.5
    lift_time: float = 0.5
    hold_time: float = 0.4
    settle_time: float = 0.05
    success_rise: float = 0.8
    release_time: float = 0.05
    control_period: float = 0.01
    largest_speed: float = 20.0

    def __post_init__(self) -> None:
        times = (
            self.approach_time,
            self.closing_limit,
            self.lift_time,
            self.hold_time,
            self.release_time,
            self.control_period,
        )
        if min(times) <= 0 or self.settle_time < 0:
            raise InvalidConfigurationError("times of the lift test must be positive, in seconds")
        if not 0 < self.success_rise <= 1:
            raise InvalidConfigurationError(f"success_rise must be in (0, 1], got {self.success_rise}")

    @property
    def closing_ticks(self) -> int:
        """Control periods of closing, at most."""
        return round(self.closing_limit / self.control_period)

    @property
    def settling_ticks(self) -> int:
        """Control periods after closing and before the lift."""
        return round(self.settle_time / self.control_period)

    @property
    def ticks_after_closing(self) -> int:
        """Control periods after closing at the end of which an object that is never touched is lost."""
        return self.settling_ticks + math.ceil(self.release_time / self.control_period) + 1


@dataclass(frozen=True)
class Verdict:
    """How an attempt ended.

    Attributes:
        outcome: NO_CONTACT, DROPPED, SUCCESS or DIVERGED where physics ran.
        held: Whether a success also held against pushes; False for any other outcome, and where that was not tried.
    """

    outcome: Outcome
    held: bool = False


@dataclass(frozen=True)
class Asked:
    """What is asked of physics beside the outcome.

    Attributes:
        hold: The harder criterion, if it is to be tried after a success.
        observe: Called after every control period, also of what is not played.
        ends_early: Whether physics ends once the outcome is certain.
    """

    hold: HoldConfig | None = None
    observe: Observer | None = None
    ends_early: bool = True


def execute(
    rig: Rig,
    attempt: Attempt,
    motion: Motion,
    config: LiftConfig,
    asked: Asked = Asked(),
    free: FreePart | None = None,
) -> Verdict:
    """Run an attempt from the pre-grasp to its end.

    Args:
        rig: Of the attempt's object; whatever was before does not matter.
        attempt: Hand and object.
        motion: Of the arm; the transit is not simulated.
        config: Timing and criterion.
        asked: What else is wanted.
        free: What need not be played; everything is by default.
    """
    rig.prepare(attempt)
    run = _Run(rig, attempt, motion, config, asked, free)
    outcome, hold = Outcome.DIVERGED, asked.hold
    try:
        outcome = run.outcome()
        held = hold is not None and outcome == Outcome.SUCCESS and holds(rig, hold, run.tick, config.control_period)
        return Verdict(outcome, held)
    except DivergedError:
        return Verdict(outcome)
    finally:
        rig.engine.stop()


class _Run:
    """One attempt in progress."""

    def __init__(
        self,
        rig: Rig,
        attempt: Attempt,
        motion: Motion,
        config: LiftConfig,
        asked: Asked,
        free: FreePart | None,
    ) -> None:
        self.rig, self.attempt, self.motion, self.config = rig, attempt, motion, config
        self.observe, self.ends_early, self.free = asked.observe, asked.ends_early, free
        self.closing = self.advancing = self.touched = False
        self.released = 0.0

    def outcome(self) -> Outcome:
        """Run all phases."""
        self.rig.set_arm(self.motion.approach[0])
        self.rig.engine.start()
        certain = self._close(self._approach())
        if not self.touched:
            return Outcome.NO_CONTACT
        return Outcome.SUCCESS if not certain and self._lift() else Outcome.DROPPED

    def _approach(self) -> int:
        """Come to h, and to the tick of the closing from which on it is played."""
        path, duration, free = self.motion.approach, self.config.approach_time, self.free
        if free is None or free.window is None:
            self._follow(path, duration)
            return 0
        if free.approach:
            for angles in self._set_points(path, duration) if self.observe is not None else path[-1:]:
                self.rig.set_arm(angles)
                self._show()
        else:
            self._follow(path, duration)
        return 0 if self.touched else self._skip(free, min(free.before, self.config.closing_ticks))

    def _skip(self, free: FreePart, ticks: int) -> int:
        """Close by so many ticks without physics; how many they were."""
        if ticks <= 0:
            return 0
        self.rig.set_arm(self.motion.approach[-1])
        for tick in range(1, ticks + 1) if self.observe is not None else [ticks]:
            self.rig.move_hand_on(free.closing.states[tick])
            self._show()
        return ticks

    def _close(self, first: int) -> bool:
        """Close until no motor advances, and settle; from now on the motors keep their torque.

        Returns:
            Whether it was certain before the end that the lift is in vain.
        """
        self.closing = self.advancing = True
        for tick in range(first + 1, self.config.closing_ticks + 1):
            self.tick()
            if self.ends_early and self._is_in_vain(tick):
                return True
            if not self.advancing:
                break
        self._wait(self.config.settle_time)
        return False

    def _is_in_vain(self, tick: int) -> bool:
        """Whether nothing is touched any more, and the object was not touched or is lost."""
        free, config, rig = self.free, self.config, self.rig
        if free is None or not free.goes_on(rig, tick):
            return False
        if not self.touched:
            return free.is_passed(rig, tick)
        left = (config.closing_ticks - tick + config.ticks_after_closing) * config.control_period
        return self.released > config.release_time and free.is_lost(rig, tick, left)

    def _lift(self) -> bool:
        """Rise and hold; whether the criterion of `LiftConfig` is met. Ends early once the object is lost."""
        rig, config = self.rig, self.config
        hand, item = rig.heights()
        self.released = 0.0
        held = self._follow(self.motion.lift, config.lift_time) and self._wait(config.hold_time)
        hand_after, item_after = rig.heights()
        return held and item_after - item >= config.success_rise * (hand_after - hand)

    def _follow(self, path: Float64[np.ndarray, "waypoints 6"], duration: float) -> bool:
        """Move the arm's set-points smoothly along a path; False as soon as the object is lost after closing."""
        for angles in self._set_points(path, duration):
            self.rig.command_arm(angles)
            if not self.tick():
                return False
        return True

    def _set_points(self, path: Float64[np.ndarray, "waypoints 6"], duration: float) -> Iterator[Angles]:
        """Of the arm, one a control period."""
        ticks = max(1, round(duration / self.config.control_period))
        for fraction in np.arange(1, ticks + 1) / ticks:
            # 3 f^2 - 2 f^3: at rest at both ends.
            smooth = fraction * fraction * (3.0 - 2.0 * fraction) * (len(path) - 1)
            index = min(int(smooth), len(path) - 2)
            yield path[index] + (smooth - index) * (path[index + 1] - path[index])

    def _wait(self, duration: float) -> bool:
        return all(self.tick() for _ in range(round(duration / self.config.control_period)))

    def tick(self) -> bool:
        """One control period; False once hand and object were apart for longer than the release time."""
        rig, period = self.rig, self.config.control_period
        self.advancing = self.closing and rig.hand.close(rig.data, self.attempt.grasp_type, period)
        rig.step(period, self.config.largest_speed)
        touching = rig.engine.touching()
        self.touched |= touching
        self.released = 0.0 if touching else self.released + period
        if self.observe is not None:
            self.observe(rig.model, rig.data)
        return not self.touched or self.released <= self.config.release_time

    def _show(self) -> None:
        """One control period that is not played, to whom it concerns."""
        if self.observe is not None:
            self.rig.pass_time(self.config.control_period)
            self.observe(self.rig.model, self.rig.data)
