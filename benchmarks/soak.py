"""Many plans in one process: does memory stay flat, and do threads get the same answers?

    python benchmarks/soak.py [--plans 100000] [--threads 4] [--model DIR] [--json results/soak.json]

Images of the household objects, drawn once, are planned again and again with a few seeds, first in one thread, then,
from the start, in several; resident memory is read as the plans go on. Every plan of one image and seed must be the
same.
"""

from __future__ import annotations

import hashlib
import resource
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
import tyro

from bayesgrasp.cli.progress import counting
from bayesgrasp.evaluation.scenes import SceneMaker
from bayesgrasp.files import write_json
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.planning.planner import Planner
from bayesgrasp.workflows.load import DEFAULT_MODEL, load_planner

IMAGES, SEEDS = 8, 3
EVERY = 500
"""Plans between two readings of the memory."""
SETTLED = 1000
"""Plans after which memory must not grow any more."""


@dataclass
class Soak:
    """What was found.

    Attributes:
        plans: How many.
        different: Plans that were not what the first one of the same image and seed was.
        memory_mib: Resident memory every `EVERY` plans.
        seconds: For all plans.
    """

    plans: int = 0
    different: int = 0
    memory_mib: list[float] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def growth(self) -> float:
        """MiB gained since memory settled."""
        settled = self.memory_mib[SETTLED // EVERY :]
        return settled[-1] - settled[0] if settled else 0.0


def main(
    plans: int = 100_000, threads: int = 4, model: Path = DEFAULT_MODEL, seed: int = 5000, json: Path | None = None
) -> None:
    """Print plans a second, growth of memory and differences.

    Args:
        plans: In one thread; in several, a tenth of them.
        threads: Of the second part.
        model: Whose plans.
        seed: Of the images.
        json: Where to write the numbers.
    """
    torch.set_num_threads(1)
    planner, scenes = load_planner(model), SceneMaker(load_objects("household"), seed)
    images = [scenes.make(number).depth for number in range(IMAGES)]
    expected = {key: digest(planner, images, key) for key in range(IMAGES * SEEDS)}
    with counting("plans", plans + plans // 10) as progress:
        alone = soak(plans, lambda number: one(planner, images, expected, number), progress, 1)
        together = soak(
            plans // 10, lambda n: one(planner, images, expected, n), lambda n: progress(plans + n), threads
        )
    for name, found in ((1, alone), (threads, together)):
        print(
            f"{found.plans} plans in {name} threads: {found.plans / found.seconds:.1f}/s, {found.different} different, "
            f"memory {found.memory_mib[0]:.0f} to {found.memory_mib[-1]:.0f} MiB, {found.growth:+.1f} since it settled"
        )
    if json is not None:
        parts = {"one_thread": vars(alone) | {"growth": alone.growth}, f"{threads}_threads": vars(together)}
        write_json(json, {"images": IMAGES, "seeds": SEEDS, **parts})


def soak(plans: int, work: Callable[[int], bool], progress: Callable[[int], None], threads: int) -> Soak:
    """Plan again and again."""
    found, started = Soak(memory_mib=[memory()]), time.perf_counter()
    with ThreadPoolExecutor(threads) as pool:
        for first in range(0, plans, EVERY):
            same = list(pool.map(work, range(first, min(first + EVERY, plans))))
            found.plans += len(same)
            found.different += same.count(False)
            found.memory_mib.append(memory())
            progress(found.plans)
    found.seconds = time.perf_counter() - started
    return found


def one(planner: Planner, images: list[np.ndarray], expected: dict[int, str], number: int) -> bool:
    """Whether a plan is what it was before."""
    key = number % len(expected)
    return digest(planner, images, key) == expected[key]


def digest(planner: Planner, images: list[np.ndarray], key: int) -> str:
    """All grasps of a plan, to the last bit."""
    plan = planner.plan(images[key % IMAGES], canonical_camera(), seed=key // IMAGES)
    content = hashlib.sha256(str(plan.reason).encode())
    for grasp in plan.grasps:
        content.update(grasp.hand_to_world.tobytes() + np.float64(grasp.log_posterior).tobytes())
    return content.hexdigest()


def memory() -> float:
    """Resident memory of this process, MiB; where the system does not say, the largest it has been."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 2**20
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


if __name__ == "__main__":
    tyro.cli(main)
