"""Speed of the data engine, in one run: end to end, per stage, the loader, and bytes per record.

    python benchmarks/generate.py [--attempts 8192] [--ycb-dir DIR] [--split train] [--proposal prior|adaptive]

Rates are printed by the wall clock, for a machine that does nothing else, and by the processor time of all workers,
which holds on a busy machine too. Pairs are hands of scenes that stand for something (weight above 0).
"""

from __future__ import annotations

import resource
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import torch
import tyro

from bayesgrasp.assets.catalogue import load_objects
from bayesgrasp.data.engine import Recipe, Run, open_store
from bayesgrasp.data.generate import ChunkMaker, GenerateConfig, SimulatedWorld
from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.data.pool import LocalPool
from bayesgrasp.data.proposal import AdaptiveConfig, Proposal
from bayesgrasp.data.provenance import describe
from bayesgrasp.data.shards import encode
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import CameraNuisances, Scenes


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
    """

    attempts: int = 8192
    split: str = "train"
    ycb_dir: Path | None = None
    proposal: Literal["prior", "adaptive"] = "prior"
    first_round: int = 1
    workers: tuple[int, ...] = (1, 2)


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
    print(f"{len(world.objects)} objects, {options.attempts} attempts, proposal {options.proposal}")
    stages(world, config, scene)
    with tempfile.TemporaryDirectory() as folder:
        for workers in options.workers:
            directory = Path(folder) / str(workers)
            end_to_end(directory, world, config, scene, options.attempts, workers)
        loading(directory)


def stages(world: SimulatedWorld, config: GenerateConfig, scene: ScenePrior) -> None:
    """Processor time of each stage of a chunk."""
    maker = ChunkMaker(world(), config, 0, scene)
    prior = Proposal.prior(scene.num_objects)
    maker.make(0, config.attempts_per_chunk, prior)  # compile models and kernels
    clock = [time.process_time()]
    attempts = maker.propose(1, config.attempts_per_chunk, prior)
    clock.append(time.process_time())
    attempts = replace(attempts, outcome=maker.world.lift_test(attempts))
    clock.append(time.process_time())
    chunk = maker.make(1, config.attempts_per_chunk, prior)
    clock.append(time.process_time())
    camera = CameraNuisances(
        **{name: chunk.scenes.columns()[f"camera_{name}"] for name in CameraNuisances.__dataclass_fields__}
    )
    where = Scenes(chunk.scenes.object_index, chunk.scenes.scale, chunk.scenes.object_pose)
    maker.world.render(where, camera, np.random.default_rng(0))
    clock.append(time.process_time())
    encode(chunk, 1)
    clock.append(time.process_time())
    propose, lift, whole, render, store = np.diff(clock)
    n, m = len(chunk.attempts), len(chunk.scenes)
    print(f"propose  {propose / n * 1e6:8.0f} us an attempt (prior)")
    print(f"lift     {lift / n * 1e6:8.0f} us an attempt: {n / lift:.0f}/s")
    print(f"pair     {(whole - propose - lift - render) / m * 1e3:8.2f} ms a scene of {config.pairing.hands} hands")
    print(f"render   {render / m * 1e3:8.2f} ms a scene: {m / render:.0f}/s")
    print(f"encode   {store / n * 1e6:8.0f} us an attempt with its share of scenes")


def end_to_end(
    directory: Path, world: SimulatedWorld, config: GenerateConfig, scene: ScenePrior, attempts: int, workers: int
) -> None:
    """One whole run, with its start."""
    store = open_store(directory, describe(world, config, 0, scene, attempts), False)
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    own = time.process_time()
    manifest = Run(store, Recipe(world, config, 0, scene), attempts).execute(LocalPool(workers))
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime + time.process_time() - own
    successes = manifest.totals["outcomes"]["success"]
    pairs = sum(int((store.chunk(chunk).hands.weight > 0).sum()) for chunk in store.entries())
    print(
        f"{workers} worker(s): {wall:.1f} s, {attempts / wall:.0f} attempts/s, {successes / wall:.1f} successes/s, "
        f"{pairs / wall:.0f} pairs/s; processor {cpu:.1f} s: {attempts / cpu:.0f} attempts/s, "
        f"{successes / cpu:.1f} successes/s, {pairs / cpu:.0f} pairs/s per core; "
        f"largest worker so far {after.ru_maxrss / 2**10:.0f} MiB"
    )


def loading(directory: Path) -> None:
    """Bytes per record, and images per second from the memory map."""
    dataset = GraspDataset(directory)
    attempts = sum(entry.attempts for entry in dataset.entries.values())
    scenes = sum(entry.scenes for entry in dataset.entries.values())
    for table, rows in (("attempts", attempts), ("scenes", scenes)):
        size = sum(path.stat().st_size for path in (directory / table).iterdir())
        print(f"{table}: {size / rows:.1f} bytes a record")
    start = time.process_time()
    loader = dataset.scenes("all", batch_size=64)
    print(f"unpack: {scenes / (time.process_time() - start):.0f} images/s")
    start = time.process_time()
    epochs = 20
    for epoch in range(epochs):
        for _ in loader(epoch):
            pass
    print(f"load: {epochs * scenes / (time.process_time() - start):.0f} images/s (from a warm page cache)")
    print(f"this process at its largest: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10:.0f} MiB")


if __name__ == "__main__":
    main(tyro.cli(Options))
