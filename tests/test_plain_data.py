"""Dataclasses from JSON: every type that our files use, and nothing that only looks like it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import pytest

from bayesgrasp.plain_data import Limits, is_number, plain, restored


@dataclass(frozen=True)
class Inner:
    word: str
    kind: Literal["a", "b"] = "a"


@dataclass(frozen=True)
class Outer:
    count: int
    share: float
    flag: bool
    inner: Inner
    pair: tuple[int, float]
    many: tuple[float, ...] = ()
    maybe: tuple[str, ...] | None = None
    rows: list[list[int]] | None = None
    named: Mapping[str, Inner] | None = None
    free: dict[str, Any] | None = None


GIVEN = Outer(3, 0.5, True, Inner("x", "b"), (1, 2.5), (1.0,), ("a",), [[1], []], {"n": Inner("y")}, {"z": [None, "q"]})


def test_what_was_plain_is_restored() -> None:
    assert restored(Outer, json.loads(json.dumps(plain(GIVEN)))) == GIVEN
    few = Outer(1, 1.0, False, Inner("x"), (1, 1.0))
    assert restored(Outer, json.loads(json.dumps(plain(few)))) == few


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 3.0}, "count must be a whole number, got 3.0"),
        ({"count": True}, "count must be a whole number, got True"),
        ({"count": "3"}, "count must be a whole number, got '3'"),
        ({"count": 2**70}, "count must be a whole number"),
        ({"share": float("nan")}, "share must be a finite number"),
        ({"share": float("inf")}, "share must be a finite number"),
        ({"share": None}, "share must be a finite number"),
        ({"flag": 1}, "flag must be bool, got 1"),
        ({"inner": {"word": 3}}, r"inner\.word must be str, got 3"),
        ({"inner": {"word": "x", "kind": "c"}}, r"inner\.kind must be one of"),
        ({"inner": {"kind": "a"}}, "word"),
        ({"inner": {"word": "x", "more": 1}}, "inner must be an object with word, kind"),
        ({"inner": []}, "inner must be an object"),
        ({"pair": [1]}, "pair must be a list of 2"),
        ({"pair": [1, 2, 3]}, "pair must be a list of 2"),
        ({"many": 3}, "many must be a list"),
        ({"many": "123"}, "many must be a list"),
        ({"rows": [1]}, "rows must be a list"),
        ({"named": []}, "named must be an object"),
        ({"more\n" * 1000: 1}, "it must be an object with count"),
    ],
)
def test_what_only_looks_like_it_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message) as refused:
        restored(Outer, plain(GIVEN) | change)
    assert len(str(refused.value)) <= 160
    assert str(refused.value).isprintable()


def test_limits_bound_numbers_and_lists() -> None:
    content = plain(GIVEN)
    assert restored(Outer, content, Limits(count=3, number=2.5, items=2)) == GIVEN
    for limits in (Limits(count=2), Limits(number=2.4), Limits(items=0)):
        with pytest.raises(ValueError, match="must be"):
            restored(Outer, content, limits)


def test_numbers_are_numbers() -> None:
    assert all(map(is_number, (0, -1, 10**400, 0.5)))
    assert not any(map(is_number, (True, None, "1", float("nan"), float("inf"), [1])))
