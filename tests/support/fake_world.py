"""Cheap simulators with a known success region, for the tests of the data engine."""

from collections.abc import Callable

import numpy as np

from bayesgrasp.data.manifest import Manifest
from bayesgrasp.generation.chunks import GenerateConfig, World
from bayesgrasp.generation.proposal import AdaptiveConfig
from bayesgrasp.generation.run import Recipe
from bayesgrasp.lift.lift_test import Verdicts
from bayesgrasp.prior.planar_symmetry import to_object
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import Attempts, CameraNuisances, Outcome, Scenes

OBJECTS = 3
RADIUS = (0.06, 0.04, 0.025)
"""Success: the palm is within this distance of a point 0.16 m above the object, and is not behind the arm's reach."""
REACH = 0.13


def lift_test(attempts: Attempts) -> np.ndarray:
    relative = to_object(attempts)
    target = np.array([0.02, 0.0, 0.17])
    radius = np.array(RADIUS)[attempts.object_index]
    distance = np.linalg.norm(relative.position - target, axis=-1) / radius
    outcome = np.where(distance < 1, Outcome.SUCCESS, np.where(distance < 1.3, Outcome.DROPPED, Outcome.NO_CONTACT))
    outcome = np.where(relative.position[:, 2] < 0.14, Outcome.COLLISION, outcome)
    return np.where(reachable(attempts), outcome, Outcome.UNREACHABLE).astype(np.uint8)


def judged_by(outcomes_of: Callable[[Attempts], np.ndarray]) -> Callable[[Attempts], Verdicts]:
    """Verdicts of a lift test; a success holds where the hand is on the left."""

    def judge(attempts: Attempts) -> Verdicts:
        outcomes = outcomes_of(attempts)
        return Verdicts(outcomes, (outcomes == Outcome.SUCCESS) & (to_object(attempts).position[:, 1] > 0))

    return judge


def reachable(attempts: Attempts) -> np.ndarray:
    within: np.ndarray = attempts.position[:, 0] < REACH - 0.1 * np.abs(attempts.quaternion[:, 1])
    return within


def render(scenes: Scenes, camera: CameraNuisances, rng: np.random.Generator) -> np.ndarray:
    noise = rng.normal(0.7, 0.01, (len(scenes), 160, 256))
    noise[:, :10] = 0
    noise[:, 20:40, :20] = scenes.object_pose[:, :1, None] + 0.6
    return noise.astype(np.float32)


def build() -> World:
    """The fake simulators."""
    return World(judged_by(lift_test), render, reachable)


SMALL = GenerateConfig(
    proposal="adaptive",
    attempts_per_draw=32,
    scenes_per_draw=1,
    draws_per_chunk=4,
    adaptive=AdaptiveConfig(first_round=2, rounds=2),
)


def recipe(config: GenerateConfig = SMALL, seed: int = 1) -> Recipe:
    return Recipe(build, config, seed, ScenePrior(OBJECTS))


def manifest(attempts: int = 1, seed: int = 1) -> Manifest:
    objects = [{"id": f"fake-{i}", "sha256": "", "split": "train", "mass_kg": 0.1} for i in range(OBJECTS)]
    return Manifest(seed=seed, config={}, objects=objects, gripper="none", attempts=attempts)
