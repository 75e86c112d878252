"""Lift tests from the prior, on any number of processes, with the same result for any number.

Attempts are drawn and tested in chunks; chunk c uses the random stream at path (c,) below the seed and nothing else.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import UInt8

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.nuisance import NuisancePrior
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.seeding import generator
from bayesgrasp.types import Attempts, Outcome

CHUNK = 250


@dataclass(frozen=True)
class Priors:
    """Where attempts come from; ``scene.num_objects`` is replaced by the size of the object set in use."""

    grasp: GraspPrior = field(default_factory=GraspPrior)
    scene: ScenePrior = field(default_factory=lambda: ScenePrior(1))
    nuisance: NuisancePrior = field(default_factory=NuisancePrior)


@dataclass(frozen=True)
class Trials:
    """Attempts and their outcomes, row by row."""

    attempts: Attempts
    outcomes: UInt8[np.ndarray, "n"]

    @property
    def successes(self) -> int:
        """Number of successful attempts."""
        return int((self.outcomes == Outcome.SUCCESS).sum())


def draw_attempts(n: int, num_objects: int, priors: Priors, rng: np.random.Generator) -> Attempts:
    """Hands, scenes and nuisances from their priors, independently."""
    hands = priors.grasp.sample(n, rng)
    scenes = replace(priors.scene, num_objects=num_objects).sample(n, rng)
    return Attempts(
        position=hands.position.numpy(),
        quaternion=so3.matrix_to_quaternion(hands.rotation.double()).to(torch.float32).numpy(),
        grasp_type=hands.grasp_type.numpy().astype(np.uint8),
        **scenes.columns(),
        **priors.nuisance.sample(n, rng).columns(),
    )


def simulate(
    objects: Sequence[ObjectAsset],
    attempts: int,
    seed: int,
    workers: int = 1,
    priors: Priors | None = None,
    config: LiftTestConfig | None = None,
    screening: bool = True,
    progress: Callable[[Trials], None] | None = None,
) -> Trials:
    """Draw attempts from the prior and test them.

    Args:
        objects: The object set.
        attempts: How many.
        seed: Of all random numbers.
        workers: Processes; 1 stays in this one.
        priors: The paper's by default.
        config: Of the lift test.
        screening: Decide certain outcomes without physics.
        progress: Called with every finished chunk, in order.

    Raises:
        InvalidConfigurationError: No object, no attempt, or no worker.
    """
    if not objects or attempts < 1 or workers < 1:
        raise InvalidConfigurationError(
            f"simulation needs at least one object, attempt and worker; got {len(objects)}, {attempts} and {workers}"
        )
    job = _Job(tuple(objects), attempts, seed, priors or Priors(), config, screening)
    parts = []
    for trials in _chunks(job, workers):
        parts.append(trials)
        if progress is not None:
            progress(trials)
    return Trials(Attempts.cat([p.attempts for p in parts]), np.concatenate([p.outcomes for p in parts]))


@dataclass(frozen=True)
class _Job:
    objects: tuple[ObjectAsset, ...]
    attempts: int
    seed: int
    priors: Priors
    config: LiftTestConfig | None
    screening: bool

    @property
    def chunks(self) -> range:
        return range(-(-self.attempts // CHUNK))


def _chunks(job: _Job, workers: int) -> Iterator[Trials]:
    if workers == 1:
        yield from map(_Worker(job), job.chunks)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker, initargs=(job,)) as pool:
        yield from pool.map(_run_chunk, job.chunks)


class _Worker:
    """The lift test of one process, and the chunks it runs."""

    def __init__(self, job: _Job) -> None:
        self.job = job
        self.lift_test = LiftTest(job.objects, job.config, job.screening)

    def __call__(self, chunk: int) -> Trials:
        size = min(CHUNK, self.job.attempts - chunk * CHUNK)
        rng = generator(self.job.seed, chunk)
        attempts = draw_attempts(size, len(self.job.objects), self.job.priors, rng)
        return Trials(attempts, self.lift_test.run(attempts))


_worker: list[_Worker] = []


def _start_worker(job: _Job) -> None:
    """A pool's worker keeps its compiled models for all of its chunks: the one place for process-wide state."""
    torch.set_num_threads(1)
    _worker.append(_Worker(job))


def _run_chunk(chunk: int) -> Trials:
    return _worker[0](chunk)
