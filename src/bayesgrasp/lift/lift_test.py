"""The grasp generative model p(S | h, O, p_O, nuisances): a lift test by a simulated arm and hand (section 4.1).

An attempt runs through stages, and the first that decides names its outcome:

1. the open hand reaches below the table at h or on its straight way there: COLLISION;
2. the arm does not reach the pre-grasp, h, or the lifted hand: UNREACHABLE;
3. nothing that the hand can reach meets the object: NO_CONTACT (only with screening);
4. the open hand overlaps the object at h or on its straight way there: COLLISION;
5. the hand closes without coming near the object or the table: NO_CONTACT (only with screening);
6. no collision-free motion of the arm: UNREACHABLE;
7. physics: NO_CONTACT, DROPPED, SUCCESS or DIVERGED.

Screening changes the time that a decision takes, never the decision: without it physics runs instead and must come to
the same outcome. Where the arm finds no way there is no physics to ask, and a hand that by stages 3 and 5 can touch
nothing is NO_CONTACT.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float64, UInt8
from scipy.spatial import ConvexHull

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.lift.attempt_poses import AttemptPoses, hull_in_hand, properties
from bayesgrasp.lift.bullet.client import connect
from bayesgrasp.lift.bullet.engine import BulletEngine
from bayesgrasp.lift.engine import MujocoEngine
from bayesgrasp.lift.execution import Observer, Verdict, execute
from bayesgrasp.lift.hold import HoldConfig
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.rig import MakeEngine, Rig
from bayesgrasp.lift.screening import CLEARANCE, HandAlone, HandKinematics, JointPath, below_table, out_of_reach
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.robot.arm import ArmDescription, ur5
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.motion import Motion, plan_motion, reachable_branches
from bayesgrasp.robot.physics_scene import PhysicsConfig
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.types import Attempts, GraspType, Outcome


@dataclass(frozen=True)
class Verdicts:
    """Outcomes of attempts, and whether successes also held.

    Attributes:
        outcomes: As `LiftTest.run` gives them.
        held: Whether the grasp lifted the object and held it against the pushes of `HoldConfig`; never without lift.
    """

    outcomes: UInt8[np.ndarray, "n"]
    held: Bool[np.ndarray, "n"]


class _ObjectBench:
    """Everything compiled for one object."""

    def __init__(
        self,
        asset: ObjectAsset,
        arm: ArmDescription,
        gripper: GripperDescription,
        closing: dict[GraspType, JointPath],
        physics: PhysicsConfig,
        make_engine: MakeEngine,
    ) -> None:
        self.hand = HandAlone(gripper, asset, closing)
        self.rig = Rig(arm, gripper, asset, physics, make_engine)
        points = np.concatenate([part.vertices for part in asset.parts])
        self.hull = np.ascontiguousarray(points[ConvexHull(points).vertices])


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
            screening: Decide certain outcomes without physics.
            arm: The UR5 by default.
            gripper: The Robotiq 3-Finger by default.
        """
        self.objects = tuple(objects)
        self.config = config or LiftTestConfig()
        self.screening = screening
        self.arm = arm or ur5()
        self.gripper = gripper or robotiq_3f()
        kinematics = HandKinematics(self.gripper)
        drawback = self.config.motion.standoff
        self._open = {g: kinematics.open_points(g) for g in GraspType}
        self._reach = {g: kinematics.reach(g, drawback) for g in GraspType}
        self._closing = {g: kinematics.free_closing(g, self.config.lift.control_period) for g in GraspType}
        self._make_engine = _engine_maker(self.config)
        self._benches: dict[int, _ObjectBench] = {}

    def run(self, attempts: Attempts) -> UInt8[np.ndarray, "n"]:
        """The outcome of every attempt, as `Outcome` values; it depends on the attempt alone, not on its neighbours.

        Raises:
            InvalidConfigurationError: An attempt is not finite or names an object that is not there.
        """
        return self._test(attempts, None).outcomes

    def judge(self, attempts: Attempts) -> Verdicts:
        """Outcomes as from `run`, and whether each grasp also held the object against pushes from six sides.

        Raises:
            InvalidConfigurationError: An attempt is not finite or names an object that is not there.
        """
        return self._test(attempts, self.config.hold)

    def _test(self, attempts: Attempts, hold: HoldConfig | None) -> Verdicts:
        self._check(attempts)
        poses = AttemptPoses.of(attempts)
        outcomes = np.full(len(attempts), Outcome.COLLISION, dtype=np.uint8)
        todo = ~self._hits_table(attempts, poses)
        for row in np.flatnonzero(todo):
            todo[row] = self._reaches(poses.hand_to_world[row])
            outcomes[row] = Outcome.UNREACHABLE
        if self.screening:
            far = self._far_away(attempts, poses, todo)
            outcomes[far] = Outcome.NO_CONTACT
            todo &= ~far
        held = np.zeros(len(attempts), dtype=bool)
        for row in np.flatnonzero(todo):
            verdict = self._decide(attempts, poses, int(row), hold)
            outcomes[row], held[row] = verdict.outcome, verdict.held
        return Verdicts(outcomes, held)

    def observe(self, attempts: Attempts, observer: Observer) -> Outcome:
        """The outcome of the first attempt, with every control period of its physics shown to an observer."""
        poses = AttemptPoses.of(attempts[:1])
        if self._hits_table(attempts[:1], poses)[0]:
            return Outcome.COLLISION
        if not self._reaches(poses.hand_to_world[0]):
            return Outcome.UNREACHABLE
        return self._decide(attempts, poses, 0, None, observer).outcome

    def feasible(self, attempts: Attempts) -> Bool[np.ndarray, "n"]:
        """Whether the arm can bring the open hand to h: neither UNREACHABLE nor COLLISION."""
        self._check(attempts)
        poses = AttemptPoses.of(attempts)
        above = ~self._hits_table(attempts, poses)
        return np.array(
            [
                above[row]
                and self._reaches(pose)
                and self._approach_clearance(attempts, poses, row) >= 0.0
                and self._plan(attempts, poses, row) is not None
                for row, pose in enumerate(poses.hand_to_world)
            ],
            dtype=bool,
        )

    def _check(self, attempts: Attempts) -> None:
        for name, column in attempts.columns().items():
            if not np.isfinite(column).all():
                row = int(np.flatnonzero(~np.isfinite(column).reshape(len(column), -1).all(axis=1))[0])
                raise InvalidConfigurationError(f"attempt {row}: {name} is not finite")
        index = attempts.object_index
        if len(index) and not (index.min() >= 0 and index.max() < len(self.objects)):
            raise InvalidConfigurationError(
                f"object_index runs from {index.min()} to {index.max()}; the lift test has {len(self.objects)} objects"
            )

    def _bench(self, index: int) -> _ObjectBench:
        if index not in self._benches:
            self._benches[index] = _ObjectBench(
                self.objects[index], self.arm, self.gripper, self._closing, self.config.physics, self._make_engine
            )
        return self._benches[index]

    def _reaches(self, hand_to_world: Float64[np.ndarray, "4 4"]) -> bool:
        return bool(reachable_branches(self.arm, hand_to_world, self.config.motion))

    def _hits_table(self, attempts: Attempts, poses: AttemptPoses) -> Bool[np.ndarray, "n"]:
        """Heights are linear along the approach, so its two ends decide."""
        hits = np.zeros(len(attempts), dtype=bool)
        for grasp_type, (points, radii) in self._open.items():
            rows = attempts.grasp_type == grasp_type
            rotation, end = poses.rotation[rows], poses.hand_to_world[rows, :3, 3]
            start = end - self.config.motion.standoff * rotation[:, :, 0]
            hits[rows] = below_table(start, rotation, points, radii) | below_table(end, rotation, points, radii)
        return hits

    def _far_away(self, attempts: Attempts, poses: AttemptPoses, todo: Bool[np.ndarray, "n"]) -> Bool[np.ndarray, "n"]:
        far = np.zeros(len(attempts), dtype=bool)
        for index in np.unique(attempts.object_index[todo]):
            hull = self._bench(int(index)).hull
            for grasp_type, regions in self._reach.items():
                rows = np.flatnonzero(todo & (attempts.object_index == index) & (attempts.grasp_type == grasp_type))
                if len(rows):
                    far[rows] = out_of_reach(hull_in_hand(attempts[rows], poses, rows, hull), regions)
        return far

    def _decide(
        self,
        attempts: Attempts,
        poses: AttemptPoses,
        row: int,
        hold: HoldConfig | None,
        observer: Observer | None = None,
    ) -> Verdict:
        clearance = self._approach_clearance(attempts, poses, row)
        if clearance < 0.0:
            return Verdict(Outcome.COLLISION)
        if self.screening and self._closes_freely(attempts, poses, row, clearance):
            return Verdict(Outcome.NO_CONTACT)
        motion = self._plan(attempts, poses, row)
        if motion is None:
            here = np.arange(len(attempts)) == row
            empty = self._far_away(attempts, poses, here)[row] or self._closes_freely(attempts, poses, row, clearance)
            return Verdict(Outcome.NO_CONTACT if empty else Outcome.UNREACHABLE)
        return self._execute(GraspType(attempts.grasp_type[row]), self._rig(attempts, row), motion, hold, observer)

    def _execute(
        self, grasp_type: GraspType, rig: Rig, motion: Motion, hold: HoldConfig | None, observer: Observer | None
    ) -> Verdict:
        """Physics; where the criterion asks for it, a grasp that does not hold is DROPPED."""
        config = self.config
        must_hold = config.criterion == "hold"
        verdict = execute(rig, grasp_type, motion, config.lift, config.hold if must_hold else hold, observer)
        if must_hold and verdict.outcome == Outcome.SUCCESS and not verdict.held:
            return Verdict(Outcome.DROPPED)
        return verdict

    def _closes_freely(self, attempts: Attempts, poses: AttemptPoses, row: int, approach_clearance: float) -> bool:
        """Whether the hand, placed by `_approach_clearance`, certainly touches nothing while it comes and closes."""
        hand = self._bench(int(attempts.object_index[row])).hand
        grasp_type, pose = GraspType(attempts.grasp_type[row]), poses.hand_to_world[row]
        return min(approach_clearance, hand.closing_clearance(pose, grasp_type)) >= CLEARANCE

    def _approach_clearance(self, attempts: Attempts, poses: AttemptPoses, row: int) -> float:
        hand = self._bench(int(attempts.object_index[row])).hand
        hand.object.set(*properties(attempts, row))
        hand.place(GraspType(attempts.grasp_type[row]), poses.object_to_world[row])
        return hand.approach_clearance(poses.hand_to_world[row], self.config.motion.standoff)

    def _rig(self, attempts: Attempts, row: int) -> Rig:
        return self._bench(int(attempts.object_index[row])).rig

    def _plan(self, attempts: Attempts, poses: AttemptPoses, row: int) -> Motion | None:
        rig = self._rig(attempts, row)
        rig.prepare(GraspType(attempts.grasp_type[row]), poses.object_to_world[row], properties(attempts, row))
        return plan_motion(self.arm, poses.hand_to_world[row], self.config.motion, rig.collides)


def _engine_maker(config: LiftTestConfig) -> MakeEngine:
    """MuJoCo, or PyBullet with one connection for all objects."""
    if config.engine == "mujoco":
        return MujocoEngine
    return partial(BulletEngine, connect(), config.bullet)
