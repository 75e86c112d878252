"""The stages of the lift test, in the order in which they are asked: the first that decides names the outcome.

Screening changes the time that a decision takes, never the decision: without it physics runs instead and must come to
the same outcome. Where the arm finds no way there is no physics to ask; then a hand that by the screens can touch
nothing is NO_CONTACT, whether screening is on or off.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto

import numpy as np
from jaxtyping import Bool, Int

from bayesgrasp.lift.bench import BoundAttempt, BoundAttempts
from bayesgrasp.lift.execution import Asked, Verdict, execute
from bayesgrasp.lift.screening import below_table, object_in_hand
from bayesgrasp.robot.motion import reached
from bayesgrasp.types import Outcome

Rows = Int[np.ndarray, "rows"]
Judge = Callable[[BoundAttempts, Rows], Sequence[Verdict | None]]
"""Verdicts on some rows; None where an attempt goes on to the next stage."""


class Role(Enum):
    """What a stage is there for."""

    BRING = auto()
    """Can the arm bring the open hand to h?"""
    SCREEN = auto()
    """Is it certain without physics that the hand touches nothing?"""
    PHYSICS = auto()
    """What happens when the hand closes and rises?"""


@dataclass(frozen=True)
class Stage:
    """One stage.

    Attributes:
        name: In a word or two.
        role: What it is there for.
        decides: Outcomes that it can name.
        when: On what ground, in words.
        judge: The decision.
    """

    name: str
    role: Role
    decides: tuple[Outcome, ...]
    when: str
    judge: Judge


def judged(bound: BoundAttempts, roles: Collection[Role]) -> dict[int, Verdict]:
    """By row, the verdicts that the stages of these roles come to; rows that none of them decides are left out."""
    found: dict[int, Verdict] = {}
    for stage in STAGES:
        if stage.role in roles:
            rows = np.array([row for row in range(len(bound)) if row not in found], dtype=np.int64)
            verdicts = zip(rows.tolist(), stage.judge(bound, rows), strict=True)
            found |= {row: verdict for row, verdict in verdicts if verdict is not None}
    return found


def _hits_table(bound: BoundAttempts, rows: Rows) -> Sequence[Verdict | None]:
    """Heights are linear along the approach, so its two ends decide."""
    hits = np.zeros(len(rows), dtype=bool)
    hands, grasp_type = bound.hand_to_world[rows], bound.attempts.grasp_type[rows]
    for kind, (points, radii) in bound.benches.covers.items():
        mine = grasp_type == kind
        rotation, end = np.ascontiguousarray(hands[mine, :3, :3]), hands[mine, :3, 3]
        start = end - bound.benches.config.motion.standoff * rotation[:, :, 0]
        hits[mine] = below_table(start, rotation, points, radii) | below_table(end, rotation, points, radii)
    return _where(hits, Outcome.COLLISION)


def _is_beyond_the_arm(bound: BoundAttempts, rows: Rows) -> Sequence[Verdict | None]:
    benches = bound.benches
    return _where(~reached(benches.arm, benches.config.motion, bound.attempts[rows]), Outcome.UNREACHABLE)


def _is_far_away(bound: BoundAttempts, rows: Rows) -> Sequence[Verdict | None]:
    far = np.zeros(len(rows), dtype=bool)
    index, grasp_type = bound.attempts.object_index[rows], bound.attempts.grasp_type[rows]
    for item in np.unique(index):
        for kind, regions in bound.benches.regions.items():
            mine = np.flatnonzero((index == item) & (grasp_type == kind))
            if len(mine):
                here, hull = rows[mine], bound.benches[int(item)].hull
                linear, shift = object_in_hand(bound.attempts[here], bound.hand_to_world[here])
                far[mine] = hull.certainly_apart(linear, shift, regions)
    return _where(far, Outcome.NO_CONTACT)


def _overlaps(bound: BoundAttempts, rows: Rows) -> Sequence[Verdict | None]:
    return _where(np.array([one.approach_clearance < 0.0 for one in bound.each(rows)], dtype=bool), Outcome.COLLISION)


def _closes_freely(bound: BoundAttempts, rows: Rows) -> Sequence[Verdict | None]:
    """The way there must be clear, too."""
    free = [one.approach_is_free and one.closing_window is None for one in bound.each(rows)]
    return _where(np.array(free, dtype=bool), Outcome.NO_CONTACT)


def _finds_no_way(bound: BoundAttempts, rows: Rows) -> Sequence[Verdict | None]:
    return [_without_a_way(bound, row) if bound[row].motion is None else None for row in rows.tolist()]


def _without_a_way(bound: BoundAttempts, row: int) -> Verdict:
    one = np.array([row])
    empty = any(screen(bound, one)[0] is not None for screen in (_is_far_away, _closes_freely))
    return Verdict(Outcome.NO_CONTACT if empty else Outcome.UNREACHABLE)


def _plays_out(bound: BoundAttempts, rows: Rows) -> Sequence[Verdict | None]:
    return [_played_out(one, bound.asked) for one in bound.each(rows)]


def _played_out(one: BoundAttempt, asked: Asked) -> Verdict | None:
    """Where the criterion asks for it, a grasp that does not hold is DROPPED."""
    rig, config = one.bench.rig, one.bench.config
    if one.motion is None:
        return None
    if config.criterion == "lift":
        return execute(rig, one.attempt, one.motion, config.lift, asked, one.free_part)
    verdict = execute(rig, one.attempt, one.motion, config.lift, replace(asked, hold=config.hold), one.free_part)
    lost = verdict.outcome == Outcome.SUCCESS and not verdict.held
    return Verdict(Outcome.DROPPED) if lost else verdict


def _where(certain: Bool[np.ndarray, "rows"], outcome: Outcome) -> Sequence[Verdict | None]:
    verdict = Verdict(outcome)
    return [verdict if row else None for row in certain]


STAGES: tuple[Stage, ...] = (
    Stage(
        "table",
        Role.BRING,
        (Outcome.COLLISION,),
        "the open hand reaches below the table at h or on its straight way there",
        _hits_table,
    ),
    Stage(
        "reach",
        Role.BRING,
        (Outcome.UNREACHABLE,),
        "the arm does not reach the pre-grasp, h, or the lifted hand",
        _is_beyond_the_arm,
    ),
    Stage(
        "far away", Role.SCREEN, (Outcome.NO_CONTACT,), "nothing that the hand can touch is the object", _is_far_away
    ),
    Stage(
        "overlap",
        Role.BRING,
        (Outcome.COLLISION,),
        "the open hand overlaps the object at h or on its straight way there",
        _overlaps,
    ),
    Stage(
        "free closing",
        Role.SCREEN,
        (Outcome.NO_CONTACT,),
        "the hand closes without coming near the object or the table",
        _closes_freely,
    ),
    Stage(
        "motion",
        Role.BRING,
        (Outcome.UNREACHABLE, Outcome.NO_CONTACT),
        "the arm finds no motion without collision",
        _finds_no_way,
    ),
    Stage(
        "physics",
        Role.PHYSICS,
        (Outcome.NO_CONTACT, Outcome.DROPPED, Outcome.SUCCESS, Outcome.DIVERGED),
        "the hand closes on the object and rises",
        _plays_out,
    ),
)
"""The lift test."""
