"""Lift tests from the prior, on any number of processes, with the same result for any number.

Attempts are drawn and tested in chunks; each chunk has a random stream of its own below the seed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import UInt8

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.pool import Work, processes
from bayesgrasp.geometry.hand_arrays import attempts_of
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.nuisance import NuisancePrior
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.seeding import Stream, generator
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

    @staticmethod
    def cat(parts: Sequence[Trials]) -> Trials:
        """One after another."""
        return Trials(Attempts.cat([p.attempts for p in parts]), np.concatenate([p.outcomes for p in parts]))


def draw_attempts(n: int, num_objects: int, priors: Priors, rng: np.random.Generator) -> Attempts:
    """Hands, scenes and nuisances from their priors, independently."""
    hands = priors.grasp.sample(n, rng)
    scenes = replace(priors.scene, num_objects=num_objects).sample(n, rng)
    return attempts_of(hands, scenes, priors.nuisance.sample(n, rng))


@dataclass(frozen=True)
class Simulation:
    """What is tried; picklable.

    Attributes:
        objects: The object set.
        seed: Of all random numbers.
        priors: The paper's by default.
        config: Of the lift test.
        screening: Decide certain outcomes without physics.
        stream, number: Attempts of chunk c come from the stream at path (``stream``, ``number``, c).
    """

    objects: tuple[ObjectAsset, ...]
    seed: int
    priors: Priors = field(default_factory=Priors)
    config: LiftTestConfig | None = None
    screening: bool = True
    stream: Stream = Stream.TRIAL
    number: int = 0

    def start(self) -> Work[range, tuple[int, Trials]]:
        """The function that tests a chunk, given the numbers of its attempts; called once in each worker."""
        lift_test = LiftTest(self.objects, self.config, self.screening)

        def work(rows: range) -> tuple[int, Trials]:
            attempts = self.attempts(rows)
            return rows.start, Trials(attempts, lift_test.run(attempts))

        return work

    def attempts(self, rows: range) -> Attempts:
        """The attempts with these numbers, from the first of a chunk to at most its last."""
        rng = generator(self.seed, self.stream, self.number, rows.start // CHUNK)
        return draw_attempts(len(rows), len(self.objects), self.priors, rng)

    def run(self, attempts: int, workers: int = 1, progress: Callable[[Trials], None] | None = None) -> Trials:
        """Draw so many attempts and test them, in order.

        Args:
            attempts: How many.
            workers: Processes; 1 stays in this one.
            progress: Called with every finished chunk, in any order.

        Raises:
            InvalidConfigurationError: No object, no attempt, or no worker.
        """
        if not self.objects or attempts < 1 or workers < 1:
            raise InvalidConfigurationError(
                "simulation needs at least one object, attempt and worker; "
                f"got {len(self.objects)}, {attempts} and {workers}"
            )
        chunks = [range(first, min(first + CHUNK, attempts)) for first in range(0, attempts, CHUNK)]
        done: dict[int, Trials] = {}
        with processes(workers).start(self.start) as run:
            for first, trials in run(chunks):
                done[first] = trials
                if progress is not None:
                    progress(trials)
        return Trials.cat([done[chunk.start] for chunk in chunks])
