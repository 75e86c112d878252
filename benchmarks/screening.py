"""Does screening ever change an outcome? Runs the same attempts with and without it and prints every difference.

python benchmarks/screening.py --attempts 20000 --ycb-dir DIR [--workers 2] [--out results/screening.json]
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
import tyro

from bayesgrasp.files import write_json
from bayesgrasp.generation.trials import Simulation
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.types import Outcome


@dataclass(frozen=True)
class Options:
    """What to compare.

    Attributes:
        attempts: How many.
        split: Objects.
        ycb_dir: Scans; by default $BAYESGRASP_YCB_DIR.
        seed: Of the attempts.
        workers: Processes.
        out: Write the report to this file.
    """

    attempts: int = 20000
    split: str = "all"
    ycb_dir: Path | None = None
    seed: int = 7
    workers: int = 2
    out: Path | None = None


def main(options: Options) -> None:
    """Compare and report."""
    objects = load_objects(options.split, options.ycb_dir)
    outcomes, seconds = {}, {}
    for screening in (True, False):
        start = perf_counter()
        trials = Simulation(objects, options.seed, screening=screening).run(options.attempts, options.workers)
        seconds[screening] = perf_counter() - start
        outcomes[screening] = trials.outcomes
    differ = np.flatnonzero(outcomes[True] != outcomes[False])
    for row in differ:
        names = [Outcome(outcomes[s][row]).name for s in (True, False)]
        print(f"attempt {row}: {objects[trials.attempts.object_index[row]].id}: {names[0]} screened, {names[1]} not")
    report = {
        "attempts": options.attempts,
        "objects": len(objects),
        "different_outcomes": len(differ),
        "different_success": int(((outcomes[True] == Outcome.SUCCESS) != (outcomes[False] == Outcome.SUCCESS)).sum()),
        "outcomes": {o.name.lower(): int((outcomes[False] == o).sum()) for o in Outcome},
        "speed_up": seconds[False] / seconds[True],
        "command": f"python benchmarks/screening.py --attempts {options.attempts} --split {options.split} "
        f"--seed {options.seed} --ycb-dir DIR",
    }
    print(json.dumps(report, indent=1))
    if options.out is not None:
        write_json(options.out, report)


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
