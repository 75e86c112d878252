"""The list of stages: what each decides, who asks which, and that no answer depends on what was asked before."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesgrasp.generation.trials import Priors, draw_attempts
from bayesgrasp.lift.bench import Benches, BoundAttempt
from bayesgrasp.lift.execution import Asked, Verdict
from bayesgrasp.lift.free_closing import Window
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.lift.stages import STAGES, Role, judged
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.robot.arm import ur5
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import generator
from bayesgrasp.types import Attempts, Outcome

DOCUMENT = Path(__file__).parents[2] / "docs" / "lift_test.md"


@pytest.fixture(scope="module")
def benches() -> Benches:
    objects = load_objects(["household_drink_can", "household_coffee_mug"])
    return Benches(objects, LiftTestConfig(), ur5(), robotiq_3f())


@pytest.fixture(scope="module")
def attempts() -> Attempts:
    return draw_attempts(300, 2, Priors(), generator(17, 0))


def test_every_stage_decides_what_it_says_and_all_together_decide_all(benches: Benches, attempts: Attempts) -> None:
    bound = benches.bind(attempts, Asked())
    rows, seen = np.arange(len(attempts)), set()
    for stage in STAGES:
        verdicts = stage.judge(bound, rows)
        named = {verdict.outcome for verdict in verdicts if verdict is not None}
        assert named <= set(stage.decides), stage.name
        seen |= {stage.name} if named else set()
        rows = rows[[verdict is None for verdict in verdicts]]
    assert len(rows) == 0
    assert {"table", "far away", "overlap", "free closing", "physics"} <= seen


def test_no_outcome_is_left_out() -> None:
    assert {outcome for stage in STAGES for outcome in stage.decides} == set(Outcome)


def test_run_observe_and_feasible_ask_the_same_list(benches: Benches, attempts: Attempts) -> None:
    lift_test = LiftTest(benches.objects)
    found = judged(benches.bind(attempts, Asked()), set(Role))
    outcomes = lift_test.run(attempts)
    assert [found[row].outcome for row in range(len(attempts))] == outcomes.tolist()
    refused = judged(benches.bind(attempts, Asked()), {Role.BRING})
    np.testing.assert_array_equal(np.flatnonzero(~lift_test.feasible(attempts)), sorted(refused))
    shown: list[float] = []
    for outcome in (Outcome.COLLISION, Outcome.NO_CONTACT):
        row = int(np.flatnonzero(outcomes == outcome)[0])
        assert lift_test.observe(attempts[row:], lambda _, data: shown.append(data.time)) == outcome
    assert shown == []


def test_screens_agree_with_physics_where_it_runs(benches: Benches, attempts: Attempts) -> None:
    bound = benches.bind(attempts, Asked())
    screened = judged(bound, {Role.BRING, Role.SCREEN})
    empty = [row for row, verdict in screened.items() if verdict.outcome == Outcome.NO_CONTACT]
    plain = judged(benches.bind(attempts[empty[:15]], Asked()), {Role.BRING, Role.PHYSICS})
    assert {verdict.outcome for verdict in plain.values()} == {Outcome.NO_CONTACT}


def test_answers_do_not_depend_on_what_was_asked_before(benches: Benches, attempts: Attempts) -> None:
    """Two attempts at one bench, their questions mixed, against each alone."""
    runs = judged(benches.bind(attempts, Asked()), set(Role))
    touched = [row for row, verdict in runs.items() if verdict.outcome in (Outcome.DROPPED, Outcome.SUCCESS)]
    near = [row for row in touched if attempts.object_index[row] == attempts.object_index[touched[0]]][:2]
    pair = attempts[near]
    alone = [answers(benches.bind(pair[[k]], Asked())[0]) for k in range(2)]
    bound = benches.bind(pair, Asked())
    first, second = bound[0], bound[1]
    mixed = (first.motion, second.closing_window, second.approach_clearance, first.closing_window, second.motion)
    assert None not in mixed
    assert [answers(first), answers(second)] == alone
    physics = STAGES[-1].judge
    forward, backward = physics(bound, np.array([0, 1])), physics(bound, np.array([1, 0]))
    assert forward == list(reversed(backward)) == [runs[row] for row in near]


def answers(one: BoundAttempt) -> tuple[float, Window | None, bytes]:
    assert one.motion is not None
    motion = one.motion.transit.tobytes() + one.motion.approach.tobytes()
    return one.approach_clearance, one.closing_window, motion


def test_without_a_way_screens_are_asked_in_any_case(benches: Benches, attempts: Attempts) -> None:
    """An arm that finds no way to a hand that can touch nothing: NO_CONTACT with and without screening."""
    bound = benches.bind(attempts, Asked())
    motion = next(stage for stage in STAGES if stage.name == "motion")
    screened = judged(bound, {Role.BRING, Role.SCREEN})
    empty = next(row for row, verdict in screened.items() if verdict.outcome == Outcome.NO_CONTACT)
    close = next(row for row in range(len(attempts)) if row not in screened)
    for row, outcome in ((empty, Outcome.NO_CONTACT), (close, Outcome.UNREACHABLE)):
        bound[row].__dict__["motion"] = None
        assert motion.judge(bound, np.array([row])) == [Verdict(outcome)]


def test_an_attempt_that_is_observed_is_checked(benches: Benches, attempts: Attempts) -> None:
    lost = replace(attempts, object_index=attempts.object_index + 2)
    with pytest.raises(ValueError, match="the lift test has 2 objects"):
        LiftTest(benches.objects).observe(lost, lambda model, data: None)


def test_the_document_has_the_list() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    rows = [f"| {stage.name} | {stage.when} |" for stage in STAGES]
    places = [text.find(row) for row in rows]
    assert -1 not in places, rows
    assert places == sorted(places)
