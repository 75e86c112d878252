"""Does screening ever change an outcome? Runs the same attempts with and without it and prints every difference.

python benchmarks/screening.py --attempts 20000 --ycb-dir DIR [--workers 2] [--out results/screening.json]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import perf_counter

import numpy as np

from bayesgrasp.generation.trials import Simulation
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.types import Outcome


def main() -> None:
    """Compare and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--attempts", type=int, default=20000)
    parser.add_argument("--split", default="all")
    parser.add_argument("--ycb-dir", type=Path, default=None)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=None)
    options = parser.parse_args()

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
        "different_success": int(((outcomes[True] == 4) != (outcomes[False] == 4)).sum()),
        "outcomes": {o.name.lower(): int((outcomes[False] == o).sum()) for o in Outcome},
        "speed_up": seconds[False] / seconds[True],
        "command": f"python benchmarks/screening.py --attempts {options.attempts} --split {options.split} "
        f"--seed {options.seed} --ycb-dir DIR",
    }
    print(json.dumps(report, indent=2))
    if options.out is not None:
        options.out.write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
