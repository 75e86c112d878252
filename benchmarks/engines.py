"""Do the two physics engines agree? The same attempts from the prior in MuJoCo and in PyBullet.

    python benchmarks/engines.py --ycb-dir DIR [--attempts 20000] [--workers 2] [--journal out/engines.jsonl]
                                 [--out results/engines.json] [--picture results/engines.png]

Prints the confusion table of outcomes, the agreement of S with Cohen's kappa (over all attempts, and over those that
physics decided, which is harder), the same for the label `held`, and success by object in both engines. The picture
shows attempts on whose S they disagree, in pairs of rows: MuJoCo above, PyBullet below, objects in turn.

With a journal every finished chunk is kept, and a run that was interrupted goes on; more attempts may be asked for.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from PIL import Image

from bayesgrasp.diagnostics.agreement import cohens_kappa, confusion
from bayesgrasp.diagnostics.intervals import paired_difference, wilson
from bayesgrasp.errors import DataError
from bayesgrasp.files import write_json
from bayesgrasp.generation.pool import processes
from bayesgrasp.generation.trials import CHUNK, Simulation
from bayesgrasp.lift.lift_config import EngineName, LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.types import Attempts, Outcome
from bayesgrasp.viewer.film import film_attempt
from bayesgrasp.viewer.raycast import contact_sheet

ENGINES: tuple[EngineName, ...] = ("mujoco", "pybullet")
ByEngine = dict[EngineName, np.ndarray]
FRAMES = 7


@dataclass(frozen=True)
class Options:
    """What to compare.

    Attributes:
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        attempts: How many.
        split: Objects.
        seed: Of the attempts; those of `bayesgrasp simulate` with this seed.
        workers: Processes.
        journal: Keeps finished chunks.
        out: Write the report to this file.
        picture: Write pictures of disagreements to this file.
        pictured: How many disagreements to picture.
    """

    ycb_dir: Path | None = None
    attempts: int = 20000
    split: str = "train"
    seed: int = 21
    workers: int = 2
    journal: Path | None = None
    out: Path | None = None
    picture: Path | None = None
    pictured: int = 6


@dataclass(frozen=True)
class Chunk:
    """Verdicts on one chunk of attempts, by engine: outcomes, and whether they held."""

    number: int
    outcomes: dict[str, list[int]]
    held: dict[str, list[bool]]


@dataclass(frozen=True)
class Comparison:
    """Builds the function that a worker runs; picklable."""

    objects: tuple[ObjectAsset, ...]
    seed: int

    def start(self) -> Callable[[int], Chunk]:
        """The function from a chunk's number to both engines' verdicts."""
        tests = {name: LiftTest(self.objects, LiftTestConfig(engine=name)) for name in ENGINES}

        def judge(number: int) -> Chunk:
            verdicts = {name: test.judge(self.attempts(number)) for name, test in tests.items()}
            return Chunk(
                number,
                {name: v.outcomes.tolist() for name, v in verdicts.items()},
                {name: v.held.tolist() for name, v in verdicts.items()},
            )

        return judge

    def attempts(self, number: int) -> Attempts:
        """The attempts of a chunk."""
        return Simulation(self.objects, self.seed).attempts(range(number * CHUNK, (number + 1) * CHUNK))


def main(options: Options) -> None:
    """Compare and report."""
    comparison = Comparison(load_objects(options.split, options.ycb_dir), options.seed)
    attempts, outcomes, held = tried(comparison, options)
    report = summarize(attempts, outcomes, held, comparison.objects)
    report["command"] = (
        f"python benchmarks/engines.py --attempts {options.attempts} --split {options.split} --seed {options.seed} "
        "--ycb-dir DIR"
    )
    print_report(report)
    if options.out is not None:
        write_json(options.out, report)
    if options.picture is not None:
        draw(attempts, outcomes, comparison.objects, options)


def tried(comparison: Comparison, options: Options) -> tuple[Attempts, ByEngine, ByEngine]:
    """The attempts, and by engine their outcomes and whether they held."""
    chunks = list(judged(comparison, options))
    attempts = Attempts.cat([comparison.attempts(chunk.number) for chunk in chunks])[: options.attempts]
    return attempts, *columns(chunks, options.attempts)


def judged(comparison: Comparison, options: Options) -> Iterator[Chunk]:
    """All chunks in order, those of the journal first read and then added to."""
    numbers = range(-(-options.attempts // CHUNK))
    with opened(options, comparison) as (kept, keep):
        todo = [number for number in numbers if number not in kept]
        if todo:
            with processes(options.workers).start(comparison.start) as work:
                for done, chunk in enumerate(work(todo), start=1):
                    keep(chunk)
                    kept[chunk.number] = chunk
                    print(f"{done}/{len(todo)} chunks", flush=True)
    yield from (kept[number] for number in numbers)


@contextmanager
def opened(options: Options, comparison: Comparison) -> Iterator[tuple[dict[int, Chunk], Callable[[Chunk], None]]]:
    """Chunks that the journal holds, and what keeps another; its first line says which run it is of."""
    if options.journal is None:
        yield {}, lambda chunk: None
        return
    ids = [asset.id for asset in comparison.objects]
    settings = [LiftTestConfig(engine=name).settings() for name in ENGINES]
    identity = json.loads(json.dumps({"seed": options.seed, "objects": ids, "settings": settings}))
    options.journal.touch()
    lines = [line for line in options.journal.read_text().splitlines(keepends=True) if line.endswith("\n")]
    if lines and json.loads(lines[0]) != identity:
        raise DataError(f"{options.journal} is of another run (seed, objects or settings); name another file")
    kept = {chunk.number: chunk for chunk in (Chunk(**json.loads(line)) for line in lines[1:])}
    options.journal.write_text("".join(lines) or json.dumps(identity) + "\n")
    with options.journal.open("a") as file:

        def keep(chunk: Chunk) -> None:
            file.write(json.dumps(asdict(chunk)) + "\n")
            file.flush()

        yield kept, keep


def columns(chunks: list[Chunk], attempts: int) -> tuple[ByEngine, ByEngine]:
    """Outcomes and held of all attempts, by engine."""
    outcomes = {e: np.concatenate([c.outcomes[e] for c in chunks])[:attempts].astype(np.uint8) for e in ENGINES}
    held = {e: np.concatenate([c.held[e] for c in chunks])[:attempts].astype(bool) for e in ENGINES}
    return outcomes, held


def summarize(
    attempts: Attempts,
    outcomes: ByEngine,
    held: ByEngine,
    objects: tuple[ObjectAsset, ...],
) -> dict[str, Any]:
    """The content of the JSON file."""
    names = [o.name.lower() for o in Outcome]
    table = confusion(outcomes["mujoco"], outcomes["pybullet"], len(names))
    touched = ((outcomes["mujoco"] >= Outcome.DROPPED) | (outcomes["pybullet"] >= Outcome.DROPPED)).astype(bool)
    success = {e: outcomes[e] == Outcome.SUCCESS for e in ENGINES}
    index = attempts.object_index
    return {
        "attempts": len(attempts),
        "objects": len(objects),
        "confusion": {
            "rows": "mujoco",
            "columns": "pybullet",
            **{n: dict(zip(names, row.tolist(), strict=True)) for n, row in zip(names, table, strict=True)},
        },
        "success": agreement(success),
        "success where the hand touched": agreement({e: label[touched] for e, label in success.items()}),
        "held": agreement(held),
        "held given success": {e: rate(held[e][success[e]]) for e in ENGINES},
        "per_object": {
            asset.id: {e: rate(success[e][index == k]) for e in ENGINES} | differences(success, index == k)
            for k, asset in enumerate(objects)
            if (index == k).any()
        },
    }


def agreement(label: ByEngine) -> dict[str, Any]:
    """Of one label in both engines."""
    first, second = (label[e] for e in ENGINES)
    difference, interval = paired_difference(first, second)
    report = {e: rate(label[e]) for e in ENGINES} | {
        "mujoco minus pybullet": {"rate": difference, "interval": interval}
    }
    table = confusion(first, second, 2)
    if (first | second).any() and not (first & second).all():
        kappa, kappa_interval = cohens_kappa(table)
        report["kappa"] = {"kappa": kappa, "interval": kappa_interval}
    return report | {"agree": float((first == second).mean())}


def differences(success: ByEngine, mask: np.ndarray) -> dict[str, int]:
    """Successes that only one engine saw."""
    first, second = (success[e][mask] for e in ENGINES)
    return {"only mujoco": int((first & ~second).sum()), "only pybullet": int((second & ~first).sum())}


def rate(label: np.ndarray) -> dict[str, Any]:
    """Successes, attempts, rate and its interval."""
    hits, total = int(label.sum()), len(label)
    if total == 0:
        return {"successes": 0, "attempts": 0, "rate": None, "interval": None}
    return {"successes": hits, "attempts": total, "rate": hits / total, "interval": wilson(hits, total)}


def print_report(report: dict[str, Any]) -> None:
    """The report for people."""
    names = [o.name.lower() for o in Outcome]
    print("MuJoCo by row, PyBullet by column")
    print(" " * 18 + "".join(f"{name:>12}" for name in names))
    for name in names:
        print(f"{name:18}" + "".join(f"{report['confusion'][name][other]:12d}" for other in names))
    for label in ("success", "success where the hand touched", "held"):
        part = report[label]
        rates = ", ".join(f"{e} {part[e]['successes']} of {part[e]['attempts']}" for e in ENGINES)
        kappa = part.get("kappa")
        beyond = f"kappa {kappa['kappa']:.3f} {[round(k, 3) for k in kappa['interval']]}" if kappa else "no kappa"
        print(f"{label}: {rates}; agree {part['agree']:.2%}, {beyond}")
    for name, row in report["per_object"].items():
        rates = "  ".join(f"{row[e]['successes']:4d}/{row[e]['attempts']}" for e in ENGINES)
        print(f"{name:28}{rates}   only mujoco {row['only mujoco']}, only pybullet {row['only pybullet']}")


def draw(attempts: Attempts, outcomes: ByEngine, objects: tuple[ObjectAsset, ...], options: Options) -> None:
    """Attempts on whose S the engines disagree, one of each object before a second of any."""
    first, second = (outcomes[e] == Outcome.SUCCESS for e in ENGINES)
    rows = np.flatnonzero(first != second)
    index = attempts.object_index[rows]
    turn = np.array([int((index[:k] == number).sum()) for k, number in enumerate(index)], dtype=np.int64)
    chosen = rows[np.argsort(turn, kind="stable")][: options.pictured]
    pictures = []
    for row in chosen:
        verdicts = ", ".join(f"{e}: {Outcome(outcomes[e][row]).name.lower()}" for e in ENGINES)
        print(f"attempt {row}: {objects[attempts.object_index[row]].id}: {verdicts}")
        for engine in ENGINES:
            pictures += film_attempt(objects, attempts[[row]], FRAMES, LiftTestConfig(engine=engine))
    if pictures and options.picture is not None:
        Image.fromarray(contact_sheet(pictures, FRAMES)).save(options.picture)


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
