"""Peak memory of the data engine as a set grows: driver, worker, unpacking, reading.

    python benchmarks/generate_memory.py [--attempts 100000 1000000 10000000] [--json FILE]

The engine is the real one: priors, pairing, shards, journal, process pool, memory maps. The simulators are A STAND-IN
that answers at once, so that 10^7 attempts take minutes instead of hours: a worker's peak here is without the models of
a real one (0.65-0.8 GiB with 24 objects, `benchmarks/generate.py`), which do not grow with the set either. Every set is
made and read in fresh processes. Chunks hold 4,096 attempts, as `generate` makes them by default, and one image.

A process that reads a memory map is charged for file pages that the system may take back at any time; what is printed
for reading is its own memory, without them. Needs Linux and about 220 bytes of disk an attempt.
"""

from __future__ import annotations

import multiprocessing
import resource
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro

from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.data.manifest import Manifest
from bayesgrasp.files import write_json
from bayesgrasp.generation.chunks import GenerateConfig, World
from bayesgrasp.generation.pool import LocalPool
from bayesgrasp.generation.run import Recipe, Run, open_store
from bayesgrasp.lift.lift_test import Verdicts
from bayesgrasp.prior.planar_symmetry import to_object
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import Attempts, CameraNuisances, Outcome, Scenes

OBJECTS = 24
CONFIG = GenerateConfig(proposal="prior", attempts_per_draw=4096, scenes_per_draw=1, draws_per_chunk=1)
TARGET, RADIUS = (0.02, 0.0, 0.17), 0.03
"""The stand-in's grasp succeeds where the palm is near a point above the object: some 0.8 % of the prior."""


def main(attempts: tuple[int, ...] = (10**5, 10**6, 10**7), json: Path | None = None) -> None:
    """Make and read one set of each size.

    Args:
        attempts: Sizes.
        json: Where to write the numbers.
    """
    rows = [measure(size) for size in attempts]
    for row in rows:
        print(", ".join(f"{name} {value:,.0f}" for name, value in row.items()))
    if json is not None:
        write_json(json, {"simulators": "a stand-in", "sets": rows})


def measure(attempts: int) -> dict[str, float]:
    """One set, made by one process and read by another."""
    with tempfile.TemporaryDirectory() as folder:
        made = alone(make, Path(folder) / "set", attempts)
        read = alone(read_all, Path(folder) / "set")
    return {"attempts": attempts, **made, **read}


def alone(function: Callable[..., dict[str, float]], *arguments: Any) -> dict[str, float]:
    """The result of a function in a process of its own."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def make(directory: Path, attempts: int) -> dict[str, float]:
    """Generate a set with one worker; peaks of driver and worker."""
    torch.set_num_threads(1)
    objects = [{"id": f"stand-in-{i}", "sha256": "", "split": "train", "mass_kg": 0.1} for i in range(OBJECTS)]
    store = open_store(directory, Manifest(0, {}, objects, "none", attempts), False)
    start = time.process_time()
    Run(store, Recipe(stand_in, CONFIG, 0, ScenePrior(OBJECTS)), attempts).execute(LocalPool(1))
    worker = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "driver MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10,
        "worker MiB": worker.ru_maxrss / 2**10,
        "processor s": time.process_time() - start + worker.ru_utime + worker.ru_stime,
    }


def read_all(directory: Path) -> dict[str, float]:
    """Unpack a set and read an epoch of its attempts and of its scenes; this process's own memory."""
    torch.set_num_threads(1)
    dataset = GraspDataset(directory)
    scenes, attempts = dataset.scenes("train"), dataset.attempts("train")
    len(attempts.columns)  # unpacks
    unpacking = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10
    reading = max(own_memory() for batches in (scenes.batches(0), attempts.batches(0)) for _ in batches)
    return {"unpacking MiB": unpacking, "reading MiB": reading}


def own_memory() -> float:
    """Memory of this process that is not a file's, MiB."""
    status = Path("/proc/self/status").read_text()
    return float(status.partition("RssAnon:")[2].split()[0]) / 2**10


def stand_in() -> World:
    """Simulators that cost next to nothing."""
    return World(lift_test, render)


def lift_test(attempts: Attempts) -> Verdicts:
    """Success near `TARGET`."""
    distance = np.linalg.norm(to_object(attempts).position - np.array(TARGET), axis=-1)
    outcomes = np.where(distance < RADIUS, np.uint8(Outcome.SUCCESS), np.uint8(Outcome.NO_CONTACT))
    return Verdicts(outcomes, distance < RADIUS)


def render(scenes: Scenes, camera: CameraNuisances, rng: np.random.Generator) -> np.ndarray:
    """A table seen from above, with the noise of a sensor."""
    return (0.7 + 0.001 * rng.integers(-3, 4, (len(scenes), 160, 256))).astype(np.float32)


if __name__ == "__main__":
    tyro.cli(main)
