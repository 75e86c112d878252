"""What each stage of the lift test costs, beside an earlier revision of the package, in processor time.

    python benchmarks/lift_stages.py --against REVISION [--ycb-dir DIR] [--json results/lift_stages.json]

Attempts from the prior, and the best fixed hands of `results/fixed_hands.json` in random scenes, of which a quarter
succeeds; with and without the harder criterion. Both revisions try the same attempts in turns, each in a process of its
own, because the speed of a busy machine changes; times are of the processor, after models and kernels were compiled.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro

from bayesgrasp.evaluation.baselines.fixed_hands import Blindfold
from bayesgrasp.files import write_json
from bayesgrasp.generation.trials import CHUNK, Simulation
from bayesgrasp.geometry.hand_arrays import attempts_of
from bayesgrasp.lift.execution import Asked
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.lift.stages import STAGES
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.types import Attempts, Hands, Outcome

ROOT = Path(__file__).parents[1]
SIDES = ("before", "now")


@dataclass(frozen=True)
class Options:
    """What to measure.

    Attributes:
        against: Revision to stand beside.
        attempts: From the prior.
        scenes: For each of the fixed hands.
        blocks: Turns into which they are divided.
        split: Objects.
        ycb_dir: Scans; by default $BAYESGRASP_YCB_DIR.
        seed: Of attempts and scenes.
        block: Measure only this block, with the package as it is imported, and print it.
        json: Where to write the numbers.
    """

    against: str = "HEAD"
    attempts: int = 6000
    scenes: int = 400
    blocks: int = 3
    split: str = "train-ycb"
    ycb_dir: Path | None = None
    seed: int = 3
    block: int | None = None
    json: Path | None = None


def main(options: Options) -> None:
    """Measure both revisions and report, or measure one block."""
    if options.block is not None:
        print(json.dumps(block(options)))
        return
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(["git", "archive", options.against, "src"], cwd=ROOT, capture_output=True, check=True)
        with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as tar:
            tar.extractall(folder, filter="data")
        sources = {"before": Path(folder) / "src", "now": ROOT / "src"}
        blocks = [{side: in_turn(sources[side], number) for side in SIDES} for number in range(options.blocks)]
    report = {"command": " ".join(sys.argv), **{kind: compare(blocks, kind) for kind in blocks[0]["now"]}}
    print(json.dumps(report, indent=1))
    if options.json is not None:
        write_json(options.json, report)


def in_turn(source: Path, number: int) -> dict[str, Any]:
    """A block, measured with the package of a source folder."""
    command = [sys.executable, __file__, *sys.argv[1:], "--block", str(number)]
    environment = {**os.environ, "PYTHONPATH": str(source)}
    answer = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True, text=True).stdout
    measured: dict[str, Any] = json.loads(answer.splitlines()[-1])
    return measured


def block(options: Options) -> dict[str, Any]:
    """Seconds of each stage, and outcomes, by kind of attempts."""
    torch.set_num_threads(1)
    objects = load_objects(options.split, options.ycb_dir)
    lift_test = LiftTest(objects)
    warm = Simulation(objects, options.seed, number=1).attempts(range(2 * CHUNK))
    staged(lift_test, warm, Asked(hold=lift_test.config.hold))
    hands = fixed_attempts(objects, options)
    return {
        "prior": staged(lift_test, prior_attempts(objects, options), Asked()),
        "fixed hands": staged(lift_test, hands, Asked()),
        "fixed hands, held": staged(lift_test, hands, Asked(hold=lift_test.config.hold)),
    }


def prior_attempts(objects: tuple[ObjectAsset, ...], options: Options) -> Attempts:
    """Those of a block."""
    simulation = Simulation(objects, options.seed)
    size = options.attempts // options.blocks // CHUNK * CHUNK
    first = (options.block or 0) * size
    return Attempts.cat([simulation.attempts(range(c, c + CHUNK)) for c in range(first, first + size, CHUNK)])


def fixed_attempts(objects: tuple[ObjectAsset, ...], options: Options) -> Attempts:
    """Each of the best fixed hands in the scenes of a block."""
    rows = json.loads((ROOT / "results" / "fixed_hands.json").read_text())["rows"][:3]
    axes = [np.stack([r["approach"], r["closing"], np.cross(r["approach"], r["closing"])], axis=-1) for r in rows]
    position, types = [r["position_m"] for r in rows], [r["grasp_type"] for r in rows]
    hands = Hands(torch.tensor(position), torch.tensor(np.stack(axes)).float(), torch.tensor(types))
    blindfold = Blindfold(LiftTest(objects).run, len(objects), options.seed)
    scenes, nuisances = blindfold.scenes(options.scenes // options.blocks, options.block or 0)
    hand, scene = (index.ravel() for index in np.indices((len(rows), len(scenes))))
    return attempts_of(hands[torch.from_numpy(hand)], scenes[scene], nuisances[scene])


def staged(lift_test: LiftTest, attempts: Attempts, asked: Asked) -> dict[str, Any]:
    """Seconds of processor time and attempts asked, by stage; outcomes, and whether each grasp held."""
    bound = lift_test.benches.bind(attempts, asked)
    rows, outcomes = np.arange(len(attempts)), np.zeros(len(attempts), dtype=int)
    held, seconds, asked_of = np.zeros(len(attempts), dtype=bool), {}, {}
    for stage in STAGES:
        start = time.process_time()
        verdicts = stage.judge(bound, rows)
        seconds[stage.name], asked_of[stage.name] = time.process_time() - start, len(rows)
        for row, verdict in zip(rows.tolist(), verdicts, strict=True):
            if verdict is not None:
                outcomes[row], held[row] = verdict.outcome, verdict.held
        rows = rows[[verdict is None for verdict in verdicts]]
    return {"seconds": seconds, "asked": asked_of, "outcomes": outcomes.tolist(), "held": held.tolist()}


def compare(blocks: list[dict[str, Any]], kind: str) -> dict[str, Any]:
    """One kind of attempts in both revisions."""
    outcomes = {side: np.concatenate([b[side][kind]["outcomes"] for b in blocks]) for side in SIDES}
    held = {side: np.concatenate([b[side][kind]["held"] for b in blocks]) for side in SIDES}
    count = len(outcomes["now"])
    seconds = {
        side: {s: sum(b[side][kind]["seconds"][s] for b in blocks) for s in names(blocks, kind)} for side in SIDES
    }
    asked = {side: {s: sum(b[side][kind]["asked"][s] for b in blocks) for s in names(blocks, kind)} for side in SIDES}
    total = {side: sum(seconds[side].values()) for side in SIDES}
    won = {side: outcomes[side] == Outcome.SUCCESS for side in SIDES}
    return {
        "attempts": count,
        "milliseconds an attempt, by stage": {
            side: {s: 1e3 * value / count for s, value in seconds[side].items()} for side in SIDES
        },
        "attempts asked": asked,
        "attempts per processor second": {side: count / total[side] for side in SIDES},
        "times as fast": total["before"] / total["now"],
        "successes": {side: int(won[side].sum()) for side in SIDES},
        "success only before, only now": [int((won[a] & ~won[b]).sum()) for a, b in (SIDES, SIDES[::-1])],
        "different outcomes": int((outcomes["before"] != outcomes["now"]).sum()),
        "held only before, only now": [int((held[a] & ~held[b]).sum()) for a, b in (SIDES, SIDES[::-1])],
    }


def names(blocks: list[dict[str, Any]], kind: str) -> list[str]:
    """Of the stages, in order."""
    return list(blocks[0]["now"][kind]["seconds"])


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
