"""Damaged files in large: images, cameras, models, data sets, states and journals, each read as a user's program does.

    python benchmarks/fuzz.py [--cases 20000] [--only png camera] [--first 0] [--json results/fuzz.json]

The damages and the readers are those of the tests (`tests/support/mutations.py`, `fuzz_targets.py`). A case ends with
one clear error or with a value that makes sense; what else can happen is counted: a failure (another exception, a long
message, another value than the undamaged one where there is a checksum), a crash of the process, or no end within
`PATIENCE`. Cases run one after another in a child process, which a crash takes with it and another one replaces.
"""

from __future__ import annotations

import multiprocessing
import resource
import sys
import tempfile
import time
import warnings
from collections import Counter
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import torch
import tyro

from bayesgrasp.files import write_json

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from fuzz_targets import TARGETS, Corpus

PATIENCE = 60.0
"""A case that takes longer hangs, seconds."""
KEPT = 20
"""Failures that are told in full, for each kind of file."""


@dataclass
class Tally:
    """How the cases of one kind of file ended.

    Attributes:
        cases: How many.
        refused, read: With one clear error; with a value that makes sense.
        failures, crashes, hangs: What must not be: which cases, and how they ended.
        damages: Cases by the name of the damage.
        slowest: Seconds of the slowest case.
        memory: Largest resident memory of the process, MiB; an empty one has some 500.
    """

    cases: int = 0
    refused: int = 0
    read: int = 0
    failures: list[str] = field(default_factory=list)
    crashes: list[str] = field(default_factory=list)
    hangs: list[str] = field(default_factory=list)
    damages: dict[str, int] = field(default_factory=dict)
    slowest: float = 0.0
    memory: float = 0.0


@dataclass(frozen=True)
class Ending:
    """How one case ended."""

    number: int
    damage: str
    failure: str
    refused: bool
    seconds: float
    memory: float


def main(cases: int = 20_000, only: tuple[str, ...] = (), first: int = 0, json: Path | None = None) -> None:
    """Damage files and read them.

    Args:
        cases: In all; kinds of files share them.
        only: Kinds of files; by default all.
        first: Number of the first case of each kind, so that a later run has others.
        json: Write the figures to this file.
    """
    names = only or tuple(TARGETS)
    tallies: dict[str, Tally] = {}
    started = time.perf_counter()
    for name in names:
        tallies[name] = fuzz(name, range(first, first + -(-cases // len(names))))
        one = tallies[name]
        bad = len(one.failures) + len(one.crashes) + len(one.hangs)
        print(f"{name}: {one.cases} cases, {one.refused} refused, {one.read} read, {bad} bad", flush=True)
        for line in [*one.failures, *one.crashes, *one.hangs][:KEPT]:
            print(f"  {line}", flush=True)
    report = summary(tallies, first, time.perf_counter() - started)
    print({name: value for name, value in report.items() if name != "kinds"})
    if json is not None:
        write_json(json, report)


def summary(tallies: dict[str, Tally], first: int, seconds: float) -> dict[str, Any]:
    """The figures of a run."""
    ends: Counter[str] = Counter()
    for one in tallies.values():
        ends.update(cases=one.cases, refused=one.refused, read=one.read)
        ends.update(failures=len(one.failures), crashes=len(one.crashes), hangs=len(one.hangs))
    return {
        **ends,
        "first": first,
        "seconds": round(seconds),
        "kinds": {name: asdict(t) for name, t in tallies.items()},
    }


def fuzz(name: str, numbers: range) -> Tally:
    """All cases of a kind of file."""
    tally, place = Tally(), numbers.start
    while place < numbers.stop:
        ours, theirs = multiprocessing.Pipe()
        child = multiprocessing.get_context("spawn").Process(target=serve, args=(theirs, name, place, numbers.stop))
        child.start()
        theirs.close()
        place = listen(ours, tally, place, numbers.stop)
        if place < numbers.stop:  # the case at this place took the process with it, or has not come back
            hung = child.is_alive()
            child.kill()
            child.join()
            told = tally.hangs if hung else tally.crashes
            told.append(f"case {place}: {'no end' if hung else f'exit code {child.exitcode}'}")
            tally.cases += 1
            place += 1
        child.join()
    return tally


def listen(pipe: Connection, tally: Tally, place: int, stop: int) -> int:
    """Count what a child tells; returns the number of the first case that it did not tell of."""
    # The first case waits for imports and for the undamaged files.
    patience = 3 * PATIENCE
    try:
        while place < stop and pipe.poll(patience):
            count(tally, pipe.recv())
            place, patience = place + 1, PATIENCE
    except EOFError:
        time.sleep(1.0)  # until the process has ended, too
    return place


def count(tally: Tally, ending: Ending) -> None:
    """One more case."""
    tally.cases += 1
    tally.damages[ending.damage] = tally.damages.get(ending.damage, 0) + 1
    tally.slowest = round(max(tally.slowest, ending.seconds), 3)
    tally.memory = round(max(tally.memory, ending.memory))
    if ending.failure:
        tally.failures.append(f"case {ending.number}: {ending.failure}")
    else:
        tally.refused += ending.refused
        tally.read += not ending.refused


def serve(pipe: Connection, name: str, start: int, stop: int) -> None:
    """What a child does: one case after another, each told as soon as it has ended."""
    warnings.simplefilter("error")
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        corpus = Corpus(TARGETS[name], Path(folder) / "corpus")
        for number in range(start, stop):
            pipe.send(one_case(corpus, number))


def one_case(corpus: Corpus, number: int) -> Ending:
    """Try one case."""
    started = time.perf_counter()
    damage, failure, refused = "", "", False
    try:
        verdict = corpus.attempt(number)
        damage, refused = verdict.damage, verdict.refusal is not None
    except Exception as error:  # whatever it is, it is what this program looks for
        failure = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return Ending(number, damage, failure, refused, time.perf_counter() - started, memory)


if __name__ == "__main__":
    tyro.cli(main)
