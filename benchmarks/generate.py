"""Speed of the data engine, in one run: end to end, per stage, the loader, and bytes per record.

    python benchmarks/generate.py [--attempts 16384] [--ycb-dir DIR] [--proposal prior|adaptive] [--json FILE]

Rates are by the wall clock, for a machine that does nothing else, and by the processor time of all workers, which holds
on a busy machine too. Pairs are hands of scenes that stand for something (weight above 0). Draws are as `generate`
makes them by default; chunks are smaller, so that two workers share a small set evenly. How memory grows with the set
is in `benchmarks/generate_memory.py`.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
import tyro

from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.data.shards import encode
from bayesgrasp.files import write_json
from bayesgrasp.generation.chunks import ChunkMaker, GenerateConfig, SimulatedWorld, labels
from bayesgrasp.generation.pool import LocalPool
from bayesgrasp.generation.proposal import AdaptiveConfig, Proposal
from bayesgrasp.generation.provenance import describe
from bayesgrasp.generation.run import Recipe, Run, open_store
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import CameraNuisances, Scenes

EPOCHS = 20
"""Passes over the images, to time the loader."""
STAGE_CHUNKS = 12
"""Chunks over which stages are timed."""


@dataclass(frozen=True)
class Options:
    """What to measure.

    Attributes:
        attempts: Size of the data set of each end-to-end run.
        split: Objects.
        ycb_dir: Scans; by default $BAYESGRASP_YCB_DIR.
        proposal: See `bayesgrasp generate`.
        first_round: Chunks of the adaptive proposal's first round.
        workers: Numbers of worker processes to compare.
        json: Where to write the numbers.
    """

    attempts: int = 16384
    split: str = "train"
    ycb_dir: Path | None = None
    proposal: Literal["prior", "adaptive"] = "prior"
    first_round: int = 1
    workers: tuple[int, ...] = (1, 2)
    json: Path | None = None


def main(options: Options) -> None:
    """Run all measurements."""
    torch.set_num_threads(1)
    world = SimulatedWorld(load_objects(options.split, options.ycb_dir))
    scene = ScenePrior(len(world.objects))
    config = GenerateConfig(
        proposal=options.proposal,
        draws_per_chunk=4,
        adaptive=AdaptiveConfig(first_round=options.first_round),
    )
    report: dict[str, Any] = {
        "command": " ".join(sys.argv),
        "objects": len(world.objects),
        "attempts": options.attempts,
        "proposal": options.proposal,
        "stages": stages(world, config, scene),
        "workers": {},
    }
    with tempfile.TemporaryDirectory() as folder:
        for workers in options.workers:
            directory = Path(folder) / str(workers)
            report["workers"][workers] = end_to_end(directory, world, config, scene, options.attempts, workers)
        report["loader"] = loading(directory)
    print(json.dumps(report, indent=1))
    if options.json is not None:
        write_json(options.json, report)


def stages(world: SimulatedWorld, config: GenerateConfig, scene: ScenePrior) -> dict[str, float]:
    """Processor time of each stage, over several chunks: objects differ in what they cost."""
    maker = ChunkMaker(world.build(), config, 0, scene)
    prior = Proposal.prior(scene.num_objects)
    maker.make(0, config.attempts_per_chunk, prior)  # compile models and kernels
    propose, lift, whole, render, store, n, m = np.sum(
        [one_chunk(maker, number, config.attempts_per_chunk, prior) for number in range(1, 1 + STAGE_CHUNKS)], axis=0
    )
    return {
        "propose (prior), us an attempt": propose / n * 1e6,
        "lift test, us an attempt": lift / n * 1e6,
        "lift tests per second": n / lift,
        "choose and move hands, ms a scene": (whole - propose - lift - render) / m * 1e3,
        "render, ms a scene": render / m * 1e3,
        "images per second": m / render,
        "encode, us an attempt with its share of scenes": store / n * 1e6,
    }


def one_chunk(maker: ChunkMaker, number: int, size: int, prior: Proposal) -> list[float]:
    """Processor seconds of proposing, lifting, making the whole, rendering and encoding; attempts and scenes."""
    clock = [time.process_time()]
    attempts = maker.propose(number, size, prior)
    clock.append(time.process_time())
    attempts = replace(attempts, **labels(maker.world.lift_test(attempts)))
    clock.append(time.process_time())
    chunk = maker.make(number, size, prior)
    clock.append(time.process_time())
    camera = CameraNuisances(
        **{name: chunk.scenes.columns()[f"camera_{name}"] for name in CameraNuisances.__dataclass_fields__}
    )
    where = Scenes(chunk.scenes.object_index, chunk.scenes.scale, chunk.scenes.object_pose)
    maker.world.render(where, camera, np.random.default_rng(0))
    clock.append(time.process_time())
    encode(chunk, 1)
    clock.append(time.process_time())
    return [*np.diff(clock), len(chunk.attempts), len(chunk.scenes)]


def end_to_end(
    directory: Path, world: SimulatedWorld, config: GenerateConfig, scene: ScenePrior, attempts: int, workers: int
) -> dict[str, float]:
    """One whole run, with its start: by the wall clock, and per second of processor time."""
    store = open_store(directory, describe(world, config, 0, scene, attempts), False)
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    own = time.process_time()
    manifest = Run(store, Recipe(world.build, config, 0, scene), attempts).execute(LocalPool(workers))
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime + time.process_time() - own
    successes = manifest.totals["outcomes"]["success"]
    pairs = sum(int((store.chunk(chunk).hands.weight > 0).sum()) for chunk in store.entries())
    counts = {"attempts": attempts, "successes": successes, "pairs": pairs}
    return {
        "seconds": wall,
        "processor seconds": cpu,
        **{f"{name} per second": count / wall for name, count in counts.items()},
        **{f"{name} per processor second": count / cpu for name, count in counts.items()},
        "largest worker so far, MiB": after.ru_maxrss / 2**10,
    }


def loading(directory: Path) -> dict[str, float]:
    """Bytes per record, and images per second from the memory map."""
    dataset = GraspDataset(directory)
    attempts = sum(entry.attempts for entry in dataset.entries.values())
    scenes = sum(entry.scenes for entry in dataset.entries.values())
    report = {
        f"bytes of {table} a record": sum(path.stat().st_size for path in (directory / table).iterdir()) / rows
        for table, rows in (("attempts", attempts), ("scenes", scenes))
    }
    start = time.process_time()
    loader = dataset.scenes("all", batch_size=64)
    report["images unpacked per second"] = scenes / (time.process_time() - start)
    start = time.process_time()
    for epoch in range(EPOCHS):
        for _ in loader.batches(epoch):
            pass
    report["images loaded per second (warm page cache)"] = EPOCHS * scenes / (time.process_time() - start)
    report["this process at its largest, MiB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10
    return report


if __name__ == "__main__":
    main(tyro.cli(Options))
