"""``bayesgrasp generate``: simulate a data set of attempts, scenes and images."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from bayesgrasp.data.store import Manifest
    from bayesgrasp.generation.pool import Executor
    from bayesgrasp.generation.run import Progress


def generate(
    attempts: int,
    out: Path,
    seed: int = 0,
    workers: int = 0,
    executor: Literal["local", "ray"] = "local",
    ray_address: str | None = None,
    resume: bool = False,
    repair: bool = False,
    split: str = "train",
    ycb_dir: Path | None = None,
    mesh: Path | None = None,
    mass: float | None = None,
    proposal: Literal["prior", "adaptive"] = "prior",
    prior_share: float = 0.5,
    attempts_per_draw: int = 256,
    scenes_per_draw: int = 8,
    draws_per_chunk: int = 16,
    hands: int = 32,
) -> None:
    """Simulate lift tests and depth images, and keep them for training.

    A run that was interrupted goes on with --resume and ends with the records of an undisturbed run. The records
    depend on the seed and the options below --repair, not on workers, executor or interruptions. More attempts can be
    added to a data set by resuming it with a larger number.

    Args:
        attempts: How many lift tests the data set shall have.
        out: Directory of the data set.
        seed: Of all random numbers.
        workers: Processes on this machine, or, with Ray, chunks under way; 0 for as many as there are cores.
        executor: local, or ray (needs the extra `bayesgrasp[ray]`).
        ray_address: Address of a running Ray cluster; by default one is started on this machine.
        resume: Go on with the data set in --out, or start it where there is none.
        repair: With --resume, make damaged chunks again instead of refusing to go on.
        split: train, train-ycb, unseen, household, stand-ins, other, all, or one object's id.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        mesh: A mesh file to use instead (metres, z upwards); needs --mass.
        mass: Its mass, kg.
        proposal: Where hands are tried: prior, or adaptive (also near earlier successes, with exact weights).
        prior_share: With adaptive, the share of hands from the prior; weights are at most its inverse.
        attempts_per_draw: Attempts for each drawn mesh and scale.
        scenes_per_draw: Images for each drawn mesh and scale; 0 for attempts alone.
        draws_per_chunk: Draws in a unit of work, which is two files; raise it for sets of 10^8 attempts and more.
        hands: Hands kept for each image.
    """
    from bayesgrasp.generation.chunks import GenerateConfig, SimulatedWorld
    from bayesgrasp.generation.pairing import PairingConfig
    from bayesgrasp.generation.proposal import AdaptiveConfig
    from bayesgrasp.generation.provenance import describe
    from bayesgrasp.generation.run import Recipe, Run, open_store
    from bayesgrasp.objects.catalogue import load_objects
    from bayesgrasp.prior.scene import ScenePrior

    config = GenerateConfig(
        proposal=proposal,
        attempts_per_draw=attempts_per_draw,
        scenes_per_draw=scenes_per_draw,
        draws_per_chunk=draws_per_chunk,
        adaptive=AdaptiveConfig(prior_share=prior_share),
        pairing=PairingConfig(hands=hands),
    )
    chosen = _executor(executor, workers, ray_address)
    world = SimulatedWorld(load_objects(split, ycb_dir, mesh, mass))
    scene = ScenePrior(len(world.objects))
    store = open_store(out, describe(world, config, seed, scene, attempts), resume)
    with progress_bar(attempts) as observe:
        manifest = Run(store, Recipe(world.build, config, seed, scene), attempts, observe).execute(chosen, repair)
    print_summary(manifest, out)


def _executor(name: str, workers: int, address: str | None) -> Executor:
    from bayesgrasp.errors import InvalidConfigurationError
    from bayesgrasp.generation.pool import LocalPool

    if name == "local":
        if address is not None:
            raise InvalidConfigurationError("--ray-address goes with --executor ray")
        return LocalPool(workers or os.cpu_count() or 1)
    if importlib.util.find_spec("ray") is None:
        raise InvalidConfigurationError("--executor ray needs Ray: pip install 'bayesgrasp[ray]'")
    from bayesgrasp.generation.ray_pool import RayPool

    return RayPool(address, workers)


@contextmanager
def progress_bar(total: int) -> Iterator[Callable[[Progress], None]]:
    """A progress bar: attempts, successes, rate, time left."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("attempts"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[found]}"))
    with Bar(*columns, TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()) as bar:
        task = bar.add_task("", total=total, found="")

        def observe(progress: Progress) -> None:
            elapsed = bar.tasks[task].elapsed or 0.0
            rate = f"{progress.made / elapsed:.0f}/s" if progress.made and elapsed > 0 else "-/s"
            found = f"{progress.successes} successes, {progress.scenes} images, {rate}"
            bar.update(task, completed=min(progress.attempts, total), found=found)

        yield observe


def print_summary(manifest: Manifest, out: Path) -> None:
    """Say what a finished data set holds."""
    totals = manifest.totals
    share = totals["outcomes"]["success"] / totals["attempts"]
    print(f"{totals['attempts']} attempts, {totals['outcomes']['success']} successes ({share:.2%}),", end=" ")
    print(f"{totals['scenes']} images in {out}")
    print("outcomes: " + ", ".join(f"{name} {count}" for name, count in totals["outcomes"].items()))
