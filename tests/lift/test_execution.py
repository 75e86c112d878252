"""What physics need not play: the outcome is the same as when it plays everything, and observers see all of it."""

import mujoco
import numpy as np
import pytest

from bayesgrasp.generation.trials import Priors, draw_attempts
from bayesgrasp.lift.bench import Benches, BoundAttempt
from bayesgrasp.lift.execution import Asked, execute
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.stages import Role, judged
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.robot.arm import ur5
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import generator
from bayesgrasp.types import Outcome

CONFIG = LiftTestConfig()


@pytest.fixture(scope="module")
def played() -> list[BoundAttempt]:
    """Attempts of which some part must be played."""
    objects = load_objects(["household_drink_can", "household_tea_box", "household_ball"])
    benches = Benches(objects, CONFIG, ur5(), robotiq_3f())
    bound = benches.bind(draw_attempts(700, 3, Priors(), generator(21, 0)), Asked())
    decided = judged(bound, {Role.BRING, Role.SCREEN})
    return [bound[row] for row in range(len(bound)) if row not in decided][:30]


def outcome(one: BoundAttempt, asked: Asked, whole: bool = False) -> Outcome:
    assert one.motion is not None
    free = None if whole else one.free_part
    return execute(one.bench.rig, one.attempt, one.motion, CONFIG.lift, asked, free).outcome


def test_what_is_not_played_changes_no_outcome(played: list[BoundAttempt]) -> None:
    """On few attempts here; `benchmarks/screening.py` compares 20,000."""
    whole = [outcome(one, Asked(ends_early=False), whole=True) for one in played]
    assert [outcome(one, Asked()) for one in played] == whole
    assert len(set(whole)) >= 3


def test_an_early_end_changes_nothing_but_the_time(played: list[BoundAttempt]) -> None:
    assert [outcome(one, Asked()) for one in played] == [outcome(one, Asked(ends_early=False)) for one in played]


def test_less_is_played(played: list[BoundAttempt]) -> None:
    steps = {}
    for whole in (True, False):
        for one in played:
            one.bench.rig.data.time = 0.0
            outcome(one, Asked(ends_early=not whole), whole)
            steps[whole] = steps.get(whole, 0.0) + one.bench.rig.data.time
    assert steps[False] < 0.7 * steps[True]


def test_an_observer_sees_every_period(played: list[BoundAttempt]) -> None:
    """The hand comes to where it touches in the same time, played or not, and where physics would have it."""
    one = next(one for one in played if one.approach_is_free and one.closing_window and one.closing_window.first > 50)
    palm, tip = one.bench.rig.hand.palm, one.bench.rig.model.body("distal_a").id
    paths = {}
    for whole in (True, False):
        seen: list[tuple[float, np.ndarray]] = []

        def record(_: mujoco.MjModel, data: mujoco.MjData, seen: list[tuple[float, np.ndarray]] = seen) -> None:
            seen.append((data.time, data.xpos[[palm, tip]].copy()))

        outcome(one, Asked(observe=record, ends_early=False), whole)
        np.testing.assert_allclose([time for time, _ in seen], 0.01 * np.arange(1, len(seen) + 1), atol=1e-9)
        paths[whole] = np.array([places for _, places in seen])
    assert one.closing_window is not None
    touch = 30 + one.closing_window.first
    apart = np.linalg.norm(paths[True][:touch] - paths[False][:touch], axis=-1).max(axis=-1)
    assert apart.max() < 0.02, "a servo is behind its set-point while the arm moves"
    assert apart[60:].max() < 0.0005
