"""The grasp generative model p(S | h, O, p_O, nuisances): a lift test by a simulated arm and hand (section 4.1).

An attempt runs through the stages of `bayesgrasp.lift.stages`, and the first that decides names its outcome.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, UInt8

from bayesgrasp.lift.bench import Benches
from bayesgrasp.lift.execution import Asked, Observer
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.stages import Role, judged
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.robot.arm import ArmDescription, ur5
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.types import Attempts, Outcome


@dataclass(frozen=True)
class Verdicts:
    """Outcomes of attempts, and whether successes also held.

    Attributes:
        outcomes: As `LiftTest.run` gives them.
        held: Whether the grasp lifted the object and held it against the pushes of `HoldConfig`; never without lift.
    """

    outcomes: UInt8[np.ndarray, "n"]
    held: Bool[np.ndarray, "n"]


class LiftTest:
    """Draws outcomes of attempts. One instance a process; models are compiled when an object is first met."""

    def __init__(
        self,
        objects: Sequence[ObjectAsset],
        config: LiftTestConfig | None = None,
        screening: bool = True,
        arm: ArmDescription | None = None,
        gripper: GripperDescription | None = None,
    ) -> None:
        """Prepare.

        Args:
            objects: What `Attempts.object_index` refers to, in order.
            config: Motion, timing and numerics.
            screening: Decide certain outcomes without physics, or before its end.
            arm: The UR5 by default.
            gripper: The Robotiq 3-Finger by default.
        """
        self.config = config or LiftTestConfig()
        self.arm, self.gripper = arm or ur5(), gripper or robotiq_3f()
        self.benches = Benches(objects, self.config, self.arm, self.gripper)
        self.screening = screening
        self._roles = set(Role) if screening else set(Role) - {Role.SCREEN}

    @property
    def objects(self) -> tuple[ObjectAsset, ...]:
        """What `Attempts.object_index` refers to."""
        return self.benches.objects

    def run(self, attempts: Attempts) -> UInt8[np.ndarray, "n"]:
        """The outcome of every attempt, as `Outcome` values; it depends on the attempt alone, not on its neighbours.

        Raises:
            InvalidConfigurationError: An attempt is not finite or names an object that is not there.
        """
        return self._test(attempts, Asked(ends_early=self.screening)).outcomes

    def judge(self, attempts: Attempts) -> Verdicts:
        """Outcomes as from `run`, and whether each grasp also held the object against pushes from six sides.

        Raises:
            InvalidConfigurationError: An attempt is not finite or names an object that is not there.
        """
        return self._test(attempts, Asked(hold=self.config.hold, ends_early=self.screening))

    def observe(self, attempts: Attempts, observer: Observer) -> Outcome:
        """The outcome of the first attempt, with every control period of its physics shown to an observer.

        An attempt that is decided without physics shows nothing.

        Raises:
            InvalidConfigurationError: The attempt is not finite or names an object that is not there.
        """
        return Outcome(self._test(attempts[:1], Asked(observe=observer, ends_early=self.screening)).outcomes[0])

    def feasible(self, attempts: Attempts) -> Bool[np.ndarray, "n"]:
        """Whether the arm can bring the open hand to h: no stage that is there for that refuses.

        Raises:
            InvalidConfigurationError: An attempt is not finite or names an object that is not there.
        """
        refused = judged(self.benches.bind(attempts, Asked()), {Role.BRING})
        return np.array([row not in refused for row in range(len(attempts))], dtype=bool)

    def _test(self, attempts: Attempts, asked: Asked) -> Verdicts:
        found = judged(self.benches.bind(attempts, asked), self._roles)
        verdicts = [found[row] for row in range(len(attempts))]
        outcomes = np.array([verdict.outcome for verdict in verdicts], dtype=np.uint8)
        return Verdicts(outcomes, np.array([verdict.held for verdict in verdicts], dtype=bool))
