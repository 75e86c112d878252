"""Fresh pairs of a hand and an image under the prior, to judge a posterior by: each image shows its own attempt.

Attempts are drawn from the prior and tried until enough succeed. A success and an image of its scene are one draw from
p(h, i | S = 1), with no weight and no planar refresh, so what is judged here relies on nothing that training relied on.
Failures are plenty; a random part of them gets images, with the weight that stands for all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.trials import Simulation, Trials
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.prior.nuisance import CameraPrior
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Attempts, Outcome, Scenes

RATE = 0.008
"""Successes per attempt that a round of simulations counts on."""
LEAST = 1000
"""Attempts of a round, at least."""


@dataclass(frozen=True)
class FreshPairs:
    """Attempts with an image of each.

    Attributes:
        attempts: (n,), the successes first.
        images: Preprocessed depth in metres, 0 = no return.
        success: S, 0 or 1.
        weight: With it, the attempts follow the prior.
    """

    attempts: Attempts
    images: Float32[np.ndarray, "n 160 256"]
    success: Float32[np.ndarray, "n"]
    weight: Float32[np.ndarray, "n"]


def fresh_pairs(
    objects: Sequence[ObjectAsset],
    successes: int,
    failures: int,
    seed: int,
    workers: int = 1,
    progress: Callable[[Trials], None] | None = None,
) -> FreshPairs:
    """Simulate until there are enough successes, then show them and some of the failures.

    Args:
        objects: The object set.
        successes: At least so many.
        failures: So many of the failures are shown, or all.
        seed: Of all random numbers.
        workers: Processes of the lift tests.
        progress: Called with every finished chunk of lift tests.

    Raises:
        InvalidConfigurationError: No successes asked for.
    """
    if successes < 1 or failures < 0:
        raise InvalidConfigurationError(
            f"need at least one success and no negative number, got {successes}, {failures}"
        )
    trials = _until(objects, successes, seed, workers, progress)
    rng = generator(seed, Stream.FRESH_PAIR)
    success = trials.outcomes == Outcome.SUCCESS
    failed = np.flatnonzero(~success)
    shown = rng.choice(failed, min(failures, len(failed)), replace=False)
    rows = np.concatenate([np.flatnonzero(success), shown])
    weight = np.where(success[rows], 1.0, len(failed) / max(1, len(shown)))
    attempts = trials.attempts[rows]
    scenes = Scenes(attempts.object_index, attempts.scale, attempts.object_pose)
    images = DepthSensor(objects).images(scenes, CameraPrior().sample(len(rows), rng), rng)
    return FreshPairs(attempts, images, success[rows].astype(np.float32), weight.astype(np.float32))


def _until(
    objects: Sequence[ObjectAsset],
    successes: int,
    seed: int,
    workers: int,
    progress: Callable[[Trials], None] | None,
) -> Trials:
    """Rounds of lift tests from the prior, until enough have succeeded."""
    parts: list[Trials] = []
    found = 0
    while found < successes:
        count = max(LEAST, round((successes - found) / RATE))
        simulation = Simulation(tuple(objects), seed, stream=Stream.FRESH_TRIAL, number=len(parts))
        parts.append(simulation.run(count, workers, progress))
        found += parts[-1].successes
    return Trials.cat(parts)
