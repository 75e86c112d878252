"""Long commands, killed at random moments and resumed until they are done, against one that was left alone.

    python benchmarks/kills.py [--kills 200] [--commands generate train practice benchmark] [--json results/kills.json]

Every command runs in a process group of its own on a small job, and the whole group gets SIGKILL, as from a machine
that loses its power; then the same command is given again with --resume. Between two kills a run has at most `PATIENCE`
seconds; when it ends, another copy is begun, until there were enough kills. Each finished copy must hold, to the last
bit, what the undisturbed run holds: data, weights, results of scenes without their wall-clock times.
"""

from __future__ import annotations

import hashlib
import json as json_module
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from bayesgrasp.cli.progress import counting
from bayesgrasp.files import write_json
from bayesgrasp.workflows.load import DEFAULT_MODEL

PATIENCE = 900.0
KEPT = (".parquet", ".safetensors", ".jsonl")
"""Files that must be the same; manifests and cards hold times and places."""
DATA = "data"
JOBS: dict[str, tuple[str, ...]] = {
    "generate": (
        *("--attempts", "4096", "--attempts-per-draw", "64", "--scenes-per-draw", "2", "--draws-per-chunk", "2"),
        *("--hands", "8", "--split", "household", "--workers", "2"),
    ),
    "train": (
        *("--data", DATA, "--epochs", "6", "--estimators", "success_ratio", "success", "--threads", "1"),
        *("--patience", "0"),
    ),
    "practice": ("--model", str(DEFAULT_MODEL), "--scenes", "64", "--split", "household", "--workers", "2"),
    "benchmark": ("--attempts", "60", "--split", "household", "--strategies", "plan", "top_down", "--workers", "2"),
    "reproduce": ("--scale", "small", "--workers", "2"),
}
"""Options of every command; `DATA` stands for the data of the undisturbed `generate`."""
RESUMES = frozenset(JOBS) - {"reproduce"}
"""Commands that want to be told that they go on; the others always do."""


@dataclass
class Tally:
    """What became of a command.

    Attributes:
        kills: How often it was killed.
        copies: Runs that were finished after kills.
        differing: Of them, those that do not hold what the undisturbed run holds.
        errors: What a resumed run ended with, where it was neither killed nor done.
        orphans: Processes of a killed group that were still there a second later.
    """

    kills: int = 0
    copies: int = 0
    differing: int = 0
    orphans: int = 0
    errors: list[str] = field(default_factory=list)


def main(
    kills: int = 200,
    commands: tuple[str, ...] = ("generate", "train", "practice", "benchmark"),
    seed: int = 0,
    json: Path | None = None,
) -> None:
    """Print what became of every command.

    Args:
        kills: In all, shared equally by the commands.
        commands: Which ones.
        seed: Of the moments.
        json: Where to write the numbers.
    """
    rng, share, tallies = np.random.default_rng(seed), -(-kills // len(commands)), {}
    with tempfile.TemporaryDirectory() as place, counting("kills", share * len(commands)) as progress:
        for number, name in enumerate(commands):
            tallies[name] = torment(
                name, Path(place), share, rng, lambda done, before=number * share: progress(before + done)
            )
    for name, tally in tallies.items():
        print(
            f"{name}: {tally.kills} kills, {tally.copies} copies finished, {tally.differing} differing, "
            f"{len(tally.errors)} errors, {tally.orphans} orphans"
        )
    if json is not None:
        write_json(json, {"seed": seed, "commands": {name: vars(tally) for name, tally in tallies.items()}})


def torment(name: str, place: Path, kills: int, rng: np.random.Generator, progress: Any) -> Tally:
    """Kill and resume one command until it was killed often enough and its last copy is finished."""
    if name == "train" and not (place / "generate").exists():
        undisturbed("generate", place)
    expected, seconds = undisturbed(name, place)
    tally = Tally()
    while tally.kills < kills:
        out = place / f"{name}-{tally.copies}"
        while not finish(name, place, out, seconds, rng, tally, kills):
            progress(tally.kills)
        tally.copies += 1
        tally.differing += digest(out) != expected
    return tally


def undisturbed(name: str, place: Path) -> tuple[str, float]:
    """Digest and time of a run that is left alone."""
    started = time.perf_counter()
    process = start(name, place, place / name, resume=False)
    _, errors = process.communicate(timeout=PATIENCE)
    if process.returncode != 0:
        raise SystemExit(f"{name} fails even where it is left alone: {errors[-500:]!r}")
    return digest(place / name), time.perf_counter() - started


def finish(
    name: str, place: Path, out: Path, seconds: float, rng: np.random.Generator, tally: Tally, kills: int
) -> bool:
    """Run a copy on, and kill it at a random moment while there are kills left; whether it ended by itself."""
    process = start(name, place, out, resume=True)
    moment = rng.uniform(0.0, seconds) if tally.kills < kills else PATIENCE
    try:
        _, errors = process.communicate(timeout=moment)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        tally.kills += 1
        tally.orphans += left_behind(process.pid)
        return False
    if process.returncode != 0:
        tally.errors.append(errors[-500:].decode(errors="replace"))
    return True


def start(name: str, place: Path, out: Path, resume: bool) -> subprocess.Popen[bytes]:
    """Begin a command in a process group of its own."""
    options: Sequence[str] = [str(place / "generate") if word == DATA else word for word in JOBS[name]]
    words = [sys.executable, "-m", "bayesgrasp", name, "--out", str(out), *options]
    words += ["--resume"] * (resume and name in RESUMES)
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    return subprocess.Popen(words, start_new_session=True, **pipes)  # type: ignore[call-overload, no-any-return]


def left_behind(group: int) -> int:
    """Processes of a group that live on after a second; the dead ones that nobody has looked at do not count."""
    time.sleep(1.0)
    return sum(belongs(path, group) for path in Path("/proc").glob("[0-9]*/stat"))


def belongs(path: Path, group: int) -> bool:
    """Whether the process of a `/proc/PID/stat` is alive and in a group."""
    try:
        state, _, its_group, *_ = path.read_text().rpartition(")")[2].split()
    except OSError:  # it has just ended
        return False
    return int(its_group) == group and state not in "ZX"


def digest(out: Path) -> str:
    """What a run holds."""
    total = hashlib.sha256()
    for path in sorted(out.rglob("*")):
        if path.suffix in KEPT and "state" not in path.parts and path.name != "journal.jsonl":
            total.update(str(path.relative_to(out)).encode() + content(path))
    return total.hexdigest()


def content(path: Path) -> bytes:
    """A file's bytes; of results of scenes, what does not depend on the clock or on the order of processes."""
    if path.suffix != ".jsonl":
        return path.read_bytes()
    lines = [json_module.loads(line) for line in path.read_text().splitlines()]
    for line in lines:
        for trial in line.get("trials", {}).values():
            del trial["seconds"]
    return json_module.dumps(sorted(lines, key=lambda line: int(line.get("number", -1)))).encode()


if __name__ == "__main__":
    tyro.cli(main)
