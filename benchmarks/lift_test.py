"""Lift tests per second, side by side in one run.

Prints attempts per second from the prior with and without screening, on one process and on two, physics steps per
second, the share of each outcome, and the largest memory of a worker; and the same attempts on one process in PyBullet
instead of MuJoCo, as a ratio.

    python benchmarks/lift_test.py --ycb-dir DIR [--attempts 10000] [--out results/lift_test.json]
"""

from __future__ import annotations

import json
import resource
from pathlib import Path
from time import perf_counter, process_time

import mujoco
import numpy as np
import tyro

from bayesgrasp.diagnostics.intervals import wilson
from bayesgrasp.files import write_json
from bayesgrasp.generation.trials import CHUNK, Simulation, Trials
from bayesgrasp.lift.execution import Asked, execute
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.types import Outcome


def main(
    attempts: int = 10000, split: str = "train-ycb", ycb_dir: Path | None = None, seed: int = 3, out: Path | None = None
) -> None:
    """Measure and report.

    Args:
        attempts: How many with screening on two processes; fewer of the slower kinds.
        split: Objects.
        ycb_dir: Scans; by default $BAYESGRASP_YCB_DIR.
        seed: Of the attempts.
        out: Write the report to this file.
    """
    objects = load_objects(split, ycb_dir)
    plain = max(CHUNK, attempts // 10)
    one = rate(objects, attempts // 2, seed, 1, True)[0]
    unscreened = {workers: rate(objects, plain, seed, workers, False)[0] for workers in (1, 2)}
    steps = physics_cost(objects, seed, LiftTestConfig())[0]
    two, trials = rate(objects, attempts, seed, 2, True)
    report = {
        "objects": len(objects),
        "attempts_per_second": {
            "screening, 1 process": one,
            "screening, 2 processes": two,
            "no screening, 1 process": unscreened[1],
            "no screening, 2 processes": unscreened[2],
        },
        "physics_steps_per_second": steps,
        "outcomes": {o.name.lower(): float((trials.outcomes == o).mean()) for o in Outcome},
        "success_interval": wilson(trials.successes, len(trials.outcomes)),
        "engines": engines(objects, attempts // 2, seed),
        "memory_mib_per_worker": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024,
        "command": f"python benchmarks/lift_test.py --attempts {attempts} --split {split} --ycb-dir DIR",
    }
    print(json.dumps(report, indent=1))
    if out is not None:
        write_json(out, report)


def rate(
    objects: tuple[ObjectAsset, ...],
    attempts: int,
    seed: int,
    workers: int,
    screening: bool,
    config: LiftTestConfig | None = None,
) -> tuple[float, Trials]:
    """Attempts per second of wall-clock time, after the first chunk of every worker (which compiles models)."""
    marks: list[tuple[float, int]] = []
    simulation = Simulation(objects, seed, config=config, screening=screening)
    trials = simulation.run(
        attempts + 2 * workers * CHUNK, workers, lambda part: marks.append((perf_counter(), len(part.outcomes)))
    )
    warm = 2 * workers
    done = sum(count for _, count in marks[warm:])
    return done / (marks[-1][0] - marks[warm - 1][0]), trials


def engines(objects: tuple[ObjectAsset, ...], attempts: int, seed: int) -> dict[str, object]:
    """Both engines on the same attempts with screening, on one process, and what physics alone costs in each."""
    report: dict[str, dict[str, float]] = {}
    for config in (LiftTestConfig(), LiftTestConfig(engine="pybullet")):
        steps, seconds = physics_cost(objects, seed, config)
        report[config.engine] = {
            "attempts_per_second": rate(objects, attempts, seed, 1, True, config)[0],
            "physics_steps_per_second": steps,
            "physics_cpu_seconds_per_attempt": seconds,
        }
    mujoco, pybullet = report["mujoco"], report["pybullet"]
    ratio = {name: mujoco[name] / pybullet[name] for name in mujoco}
    return {**report, "mujoco divided by pybullet": ratio}


def physics_cost(objects: tuple[ObjectAsset, ...], seed: int, config: LiftTestConfig) -> tuple[float, float]:
    """Steps per second of processor time while hands close on objects and lift them, and its seconds per attempt.

    All of the motion is played.
    """
    attempts = Simulation(objects, seed, number=1).attempts(range(1000))
    outcomes = LiftTest(objects).run(attempts)
    touched = np.flatnonzero((outcomes == Outcome.SUCCESS) | (outcomes == Outcome.DROPPED))[:30]
    lift_test = LiftTest(objects, config)
    bound = lift_test.benches.bind(attempts[touched], Asked())
    whole = [(one, motion) for one in map(bound.__getitem__, range(len(bound))) if (motion := one.motion) is not None]
    periods = [0]

    def count(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        periods[0] += 1

    start = process_time()
    for one, motion in whole:
        execute(one.bench.rig, one.attempt, motion, config.lift, Asked(observe=count, ends_early=False))
    seconds = process_time() - start
    step = config.physics.time_step if config.engine == "mujoco" else config.bullet.time_step
    return periods[0] * config.lift.control_period / step / seconds, seconds / len(whole)


if __name__ == "__main__":
    tyro.cli(main)
