"""Damaged files in small: `benchmarks/fuzz.py` has the same ones in large."""

from pathlib import Path

import numpy as np
import pytest
from fuzz_targets import TARGETS, Corpus, Target
from mutations import BYTES, VALUES, mutated

from bayesgrasp.errors import DataError

CASES = 40
"""Of each kind of file."""


@pytest.mark.parametrize("name", TARGETS)
def test_no_damage_is_more_than_one_clear_error(name: str, tmp_path: Path) -> None:
    corpus = Corpus(TARGETS[name], tmp_path)
    for number in range(CASES):
        corpus.attempt(number)
    corpus.restore()
    assert TARGETS[name].read(tmp_path) == corpus.expected


CONTENT = b'{"a": [1, 2.5, "word"], "b": {"c": null, "d": [[1], [2]]}}'


def test_every_damage_changes_something_and_repeats_itself() -> None:
    seen = set()
    for seed in range(300):
        name, damaged = mutated(CONTENT, np.random.default_rng(seed), True)
        assert damaged != CONTENT
        assert mutated(CONTENT, np.random.default_rng(seed), True) == (name, damaged)
        seen.add(name)
    assert seen == BYTES.keys() | VALUES.keys()
    assert all(mutated(CONTENT, np.random.default_rng(seed), False)[0] in BYTES for seed in range(50))


def lenient(folder: Path) -> str:
    return str(len((folder / "file").read_bytes()))


def crashing(folder: Path) -> str:
    if (folder / "file").read_bytes() != b"whole" * 50:
        raise ZeroDivisionError
    return ""


def talkative(folder: Path) -> str:
    if (folder / "file").read_bytes() != b"whole" * 50:
        raise DataError("x" * 500)
    return ""


@pytest.mark.parametrize(
    ("read", "error"), [(lenient, AssertionError), (crashing, ZeroDivisionError), (talkative, AssertionError)]
)
def test_a_reader_that_fails_is_caught(read: object, error: type[Exception], tmp_path: Path) -> None:
    def make(folder: Path) -> None:
        (folder / "file").write_bytes(b"whole" * 50)

    corpus = Corpus(Target("file", make, read, exact=True), tmp_path)  # type: ignore[arg-type]
    with pytest.raises(error):
        any(corpus.attempt(number) is None for number in range(100))
