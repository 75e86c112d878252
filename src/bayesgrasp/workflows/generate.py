"""Data sets of attempts, scenes and images, on disk: ``bayesgrasp generate``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from bayesgrasp.data.manifest import Manifest
from bayesgrasp.generation.chunks import GenerateConfig, SimulatedWorld
from bayesgrasp.generation.pool import Executor, LocalPool
from bayesgrasp.generation.provenance import describe
from bayesgrasp.generation.run import Progress, Recipe, Run, open_store
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.prior.scene import ScenePrior


@dataclass(frozen=True)
class GenerateJob:
    """What a data set holds; fixes every record.

    Attributes:
        objects: The object set.
        attempts: How many lift tests.
        config: What is drawn, and how much of it.
        seed: Of all random numbers.
    """

    objects: tuple[ObjectAsset, ...]
    attempts: int
    config: GenerateConfig = field(default_factory=GenerateConfig)
    seed: int = 0


def generate(
    job: GenerateJob,
    out: Path | str,
    executor: Executor | None = None,
    *,
    resume: bool = False,
    repair: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Manifest:
    """Simulate lift tests and depth images, and keep them for training.

    Args:
        job: What the data set holds.
        out: Its directory.
        executor: Who does the work; by default one process. The records do not depend on it.
        resume: Go on with the data set in ``out``, or start it where there is none.
        repair: With ``resume``, make damaged chunks again instead of refusing to go on.
        progress: Told after every chunk.

    Returns:
        The manifest with the final counts.

    Raises:
        DataError: There is a data set in ``out`` already, of another kind or being written, or it is damaged.
    """
    world, scene = SimulatedWorld(job.objects), ScenePrior(len(job.objects))
    store = open_store(Path(out), describe(world, job.config, job.seed, scene, job.attempts), resume)
    run = Run(store, Recipe(world.build, job.config, job.seed, scene), job.attempts, progress)
    return run.execute(executor or LocalPool(1), repair)
