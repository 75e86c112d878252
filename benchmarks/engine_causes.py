"""Why do the two physics engines disagree? Attempts of `engines.py` again, with one cause at a time taken away.

    python benchmarks/engine_causes.py --journal out/engines.jsonl --ycb-dir DIR [--out results/engine_causes.json]

Attempts whose S the engines see differently are judged again by both, as they were and with changed physics: without
torsional friction, with half the time step, with three times the iterations of the solver, and with friction that
hardly slips (MuJoCo only, `PhysicsConfig.friction_ratio`). Reported is in how many of them each engine succeeds. The
last change is also made to all successes of MuJoCo, to see what becomes of S and of the harder label `held`.

The journal is that of `engines.py`; give it the same split and seed, and as many attempts.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import tyro
from engines import ENGINES, Comparison, Options, tried

from bayesgrasp.files import write_json
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.types import Attempts, Outcome

STICKY = 100.0
"""Impedance ratio of friction at which MuJoCo hardly slips."""
NO_TORSION = 1e-6
"""Spinning friction in place of none, metres."""


@dataclass(frozen=True)
class Change:
    """A change of physics.

    Attributes:
        name: In words.
        config: Of the lift test, changed.
        attempts: The attempts, changed.
    """

    name: str
    config: Callable[[LiftTestConfig], LiftTestConfig] = lambda config: config
    attempts: Callable[[Attempts], Attempts] = lambda attempts: attempts


def without_torsion(attempts: Attempts) -> Attempts:
    """The attempts on an object that resists no turning about a contact's normal."""
    return replace(attempts, spinning_friction=np.full_like(attempts.spinning_friction, NO_TORSION))


def finer(config: LiftTestConfig) -> LiftTestConfig:
    """Half the time step."""
    physics = replace(config.physics, time_step=config.physics.time_step / 2)
    return replace(config, physics=physics, bullet=replace(config.bullet, time_step=config.bullet.time_step / 2))


def iterated(config: LiftTestConfig) -> LiftTestConfig:
    """Three times the iterations."""
    physics = replace(config.physics, solver_iterations=3 * config.physics.solver_iterations)
    bullet = replace(config.bullet, solver_iterations=3 * config.bullet.solver_iterations)
    return replace(config, physics=physics, bullet=bullet)


def sticky(config: LiftTestConfig) -> LiftTestConfig:
    """Friction that hardly slips."""
    return replace(config, physics=replace(config.physics, friction_ratio=STICKY))


AS_THEY_WERE = Change("as they were")
STICKY_FRICTION = Change(f"friction ratio {STICKY:g}", sticky)
IN_BOTH = (
    AS_THEY_WERE,
    Change("no torsional friction", attempts=without_torsion),
    Change("half the time step", finer),
    Change("three times the iterations", iterated),
)
CHANGES = {"mujoco": (*IN_BOTH, STICKY_FRICTION), "pybullet": IN_BOTH}


def main(options: Options) -> None:
    """Judge and report."""
    comparison = Comparison(load_objects(options.split, options.ycb_dir), options.seed)
    attempts, outcomes, _ = tried(comparison, options)
    success = {engine: outcomes[engine] == Outcome.SUCCESS for engine in ENGINES}
    disputed = np.flatnonzero(success["mujoco"] != success["pybullet"])
    lifted = np.flatnonzero(success["mujoco"])
    report: dict[str, Any] = {
        "disputed": {
            "attempts": len(disputed),
            "only mujoco": int((success["mujoco"] & ~success["pybullet"]).sum()),
            "succeed": {
                engine: judge_all(comparison.objects, attempts[disputed], engine, CHANGES[engine]) for engine in ENGINES
            },
        },
        "successes of mujoco": {
            "attempts": len(lifted),
            "succeed": judge_all(comparison.objects, attempts[lifted], "mujoco", (AS_THEY_WERE, STICKY_FRICTION)),
        },
    }
    report["command"] = f"python benchmarks/engine_causes.py --attempts {options.attempts} --seed {options.seed}"
    print(json.dumps(report, indent=1))
    if options.out is not None:
        write_json(options.out, report)


def judge_all(
    objects: tuple[ObjectAsset, ...], attempts: Attempts, engine: Any, changes: tuple[Change, ...]
) -> dict[str, dict[str, int]]:
    """By change: how many attempts succeed, how many hold, and of how many the first change's S is another."""
    report: dict[str, dict[str, int]] = {}
    first = np.zeros(len(attempts), dtype=bool)
    for number, change in enumerate(changes):
        test = LiftTest(objects, change.config(LiftTestConfig(engine=engine)))
        verdicts = test.judge(change.attempts(attempts))
        success = verdicts.outcomes == Outcome.SUCCESS
        first = success if number == 0 else first
        report[change.name] = {
            "success": int(success.sum()),
            "held": int(verdicts.held.sum()),
            "changed": int((success != first).sum()),
        }
        print(f"{engine}, {change.name}: {report[change.name]}", flush=True)
    return report


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
