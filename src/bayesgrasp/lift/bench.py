"""Attempts at the benches of their objects: what the stages of the lift test ask, each answer from one place.

A bench has everything that is compiled for one object. An attempt bound to it answers for itself: every answer puts
hand and object in their places anew, so none depends on what was asked before.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np
from jaxtyping import Float64, Int
from scipy.spatial import ConvexHull

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.separation import Body, Regions
from bayesgrasp.lift.attempt import Attempt
from bayesgrasp.lift.bullet.bullet_engine import BulletEngine
from bayesgrasp.lift.bullet.client import connect
from bayesgrasp.lift.engine import MujocoEngine
from bayesgrasp.lift.execution import Asked
from bayesgrasp.lift.free_closing import FreeClosing, FreePart, Window
from bayesgrasp.lift.hand_kinematics import CLEARANCE, HandKinematics
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.rig import MakeEngine, Rig
from bayesgrasp.lift.screening import HandAlone
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.robot.arm import ArmDescription
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.motion import Motion, hand_poses, plan_motion
from bayesgrasp.robot.physics_scene import ObjectState
from bayesgrasp.types import Attempts, GraspType

MOST_COMPILED = 256
"""Benches that are kept: some 1.4 MB each, and an object set may have thousands of objects."""


class Bench:
    """Everything compiled for one object.

    Args:
        asset: The object.
        arm: The arm.
        gripper: The hand.
        closing: Its free closing motion by grasp type.
        config: Of the lift test.
        make_engine: Of the engine that moves arm, hand and object.
    """

    def __init__(
        self,
        asset: ObjectAsset,
        arm: ArmDescription,
        gripper: GripperDescription,
        closing: dict[GraspType, FreeClosing],
        config: LiftTestConfig,
        make_engine: MakeEngine,
    ) -> None:
        self.arm, self.config = arm, config
        self.hand = HandAlone(gripper, asset, closing)
        self.rig = Rig(arm, gripper, asset, config.physics, make_engine)
        points = np.concatenate([part.vertices for part in asset.parts])
        self.hull = Body(np.ascontiguousarray(points[ConvexHull(points).vertices]))


class Benches:
    """A bench for each object, compiled when the object is met, and what is known of the hand without one.

    Args:
        objects: What `Attempts.object_index` refers to, in order.
        config: Motion, timing and numerics.
        arm: The arm.
        gripper: The hand.

    Attributes:
        covers: Points and radii that cover the open hand, by grasp type; see `HandKinematics.open_points`.
        regions: What a hand of a grasp type can touch; see `HandKinematics.touchable_regions`.
    """

    def __init__(
        self, objects: Sequence[ObjectAsset], config: LiftTestConfig, arm: ArmDescription, gripper: GripperDescription
    ) -> None:
        self.objects, self.config, self.arm, self.gripper = tuple(objects), config, arm, gripper
        kinematics = HandKinematics(gripper, config.physics)
        self.covers = {g: kinematics.open_points(g) for g in GraspType}
        self.regions = {g: Regions.of(kinematics.touchable_regions(g, config.motion.standoff)) for g in GraspType}
        lift = config.lift
        self._closing = {
            g: kinematics.record_closing(g, lift.control_period, lift.closing_ticks, lift.ticks_after_closing)
            for g in GraspType
        }
        self._make_engine = _engine_maker(config)
        self._compiled: dict[int, Bench] = {}

    def __getitem__(self, index: int) -> Bench:
        """The bench of an object, by its index; the one that was not asked for longest makes room for a new one."""
        bench = self._compiled.pop(index, None)
        if bench is None:
            asset = self.objects[index]
            bench = Bench(asset, self.arm, self.gripper, self._closing, self.config, self._make_engine)
            if len(self._compiled) >= MOST_COMPILED:
                del self._compiled[next(iter(self._compiled))]
        self._compiled[index] = bench
        return bench

    def bind(self, attempts: Attempts, asked: Asked) -> BoundAttempts:
        """Attempts at their benches.

        Raises:
            InvalidConfigurationError: An attempt is not finite or names an object that is not there.
        """
        for name, column in attempts.columns().items():
            if not np.isfinite(column).all():
                row = int(np.flatnonzero(~np.isfinite(column).reshape(len(column), -1).all(axis=1))[0])
                raise InvalidConfigurationError(f"attempt {row}: {name} is not finite")
        index = attempts.object_index
        if len(index) and not (index.min() >= 0 and index.max() < len(self.objects)):
            raise InvalidConfigurationError(
                f"object_index runs from {index.min()} to {index.max()}; the lift test has {len(self.objects)} objects"
            )
        return BoundAttempts(self, attempts, asked)


class BoundAttempts:
    """Attempts, all together as columns and one by one at their benches.

    Args:
        benches: Of their objects.
        attempts: The columns.
        asked: What is asked of their physics.

    Attributes:
        hand_to_world: h of each attempt, metres.
    """

    def __init__(self, benches: Benches, attempts: Attempts, asked: Asked) -> None:
        self.benches, self.attempts, self.asked = benches, attempts, asked
        self.hand_to_world: Float64[np.ndarray, "n 4 4"] = hand_poses(attempts)
        self._bound: dict[int, BoundAttempt] = {}

    def __len__(self) -> int:
        return len(self.attempts)

    def each(self, rows: Int[np.ndarray, "rows"]) -> Iterator[BoundAttempt]:
        """Some of them, one by one."""
        return map(self.__getitem__, rows.tolist())

    def __getitem__(self, row: int) -> BoundAttempt:
        """One attempt at its bench; the same one whenever it is asked for."""
        if row not in self._bound:
            bench = self.benches[int(self.attempts.object_index[row])]
            self._bound[row] = BoundAttempt(bench, Attempt.of(self.attempts, row, self.hand_to_world[row]))
        return self._bound[row]


class BoundAttempt:
    """One attempt at the bench of its object; what costs something is found out when it is first asked, and kept.

    Args:
        bench: Of its object.
        attempt: The attempt.
    """

    def __init__(self, bench: Bench, attempt: Attempt) -> None:
        self.bench, self.attempt = bench, attempt

    @cached_property
    def approach_clearance(self) -> float:
        """Of the open hand from object and table on its straight way to h; see `HandAlone.approach_clearance`."""
        return self.bench.hand.approach_clearance(self.attempt, self.bench.config.motion.standoff)

    @property
    def approach_is_free(self) -> bool:
        """Whether the hand certainly touches nothing on its way to h."""
        return self.approach_clearance >= CLEARANCE

    @cached_property
    def closing_window(self) -> Window | None:
        """When the hand may touch something while it closes at h; see `HandAlone.closing_window`."""
        return self.bench.hand.closing_window(self.attempt)

    @property
    def free_part(self) -> FreePart | None:
        """What physics need not play; None for another engine, whose hands move otherwise, and where nothing is met."""
        free, window = self.approach_is_free, self.closing_window
        if self.bench.config.engine != "mujoco" or (free and window is None):
            return None
        closing = self.bench.hand.closing[self.attempt.grasp_type]
        return FreePart(self.attempt.item, free, closing, window, self._foresee)

    def _foresee(self, item: ObjectState, since: int, nearer: float) -> Window | None:
        return self.bench.hand.closing_window(replace(self.attempt, item=item), since, nearer)

    @cached_property
    def motion(self) -> Motion | None:
        """Of the arm with the open hand around object and table; None where it finds no way."""
        rig = self.bench.rig
        rig.prepare(self.attempt)
        return plan_motion(self.bench.arm, self.attempt.hand_to_world, self.bench.config.motion, rig.collides)


def _engine_maker(config: LiftTestConfig) -> MakeEngine:
    """MuJoCo, or PyBullet with one connection for all objects."""
    if config.engine == "mujoco":
        return MujocoEngine
    return partial(BulletEngine, connect(), config.bullet)
