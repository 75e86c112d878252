"""Independent random streams that depend on the seed and on a path, and on nothing else.

A stream is addressed, not drawn: ``generator(seed, Stream.ATTEMPT, 3, 7)`` is the same stream on any worker and in any
order (`numpy.random.SeedSequence`, spawn keys). Every path begins with an entry of one table, `Stream`, which says what
the stream is for; so two purposes never share random numbers, whatever the seed. Simulation draws from NumPy
generators, learning from torch generators.
"""

from enum import Enum, unique

import numpy as np
import torch
from numpy.random.bit_generator import ISeedSequence

from bayesgrasp.errors import InvalidConfigurationError


@unique
class Stream(Enum):
    """What random numbers are for: where the path of a stream begins, and, in the comment, how it goes on.

    No entry begins with another one. Numbers that data sets and trained weights were made with stay; a new purpose gets
    a new number.
    """

    # Training
    WEIGHTS = (0,)  # (): initial weights of an estimator
    PAIRING = (1,)  # step: pairs that a loss draws
    MIRROR = (2,)  # step: scenes that are mirrored
    VALIDATION = (2**31,)  # batch: pairs that the loss on held-out scenes draws
    SCENE_ORDER = (5,)  # epoch: order of scenes
    ATTEMPT_ORDER = (9,)  # epoch: order of attempts
    REFRESH = (10,)  # epoch: order of attempts, and the fresh poses of successes
    QUARTER_TURN = (30,)  # step: quarter turns of attempts
    TURNS = (11,)  # epoch: order of batches of several sources
    CHECK = (12,)  # batch: pairs that the checks after training draw
    POWER = (13,)  # batch, scene: hands that the power of a posterior is fitted with

    # Data sets
    ATTEMPT = (4, 0)  # chunk, draw: object, scale, hands, poses, nuisances
    SCENE = (4, 1)  # chunk, draw: poses, cameras, and which hands go with an image
    SENSOR = (4, 2)  # chunk: noise of images
    PROPOSAL = (4, 3)  # round: kernels of the adaptive proposal
    PRACTICE = (4, 6)  # chunk: scenes, cameras, noise, nuisances
    PRACTICE_FRICTION = (4, 7)  # chunk: frictions that a proposer is told
    PRACTICE_HANDS = (4, 8)  # chunk: hands of a proposer
    COPIES = (7,)  # (): deformed copies of objects

    # Objects
    PROCEDURAL = (40,)  # index: kind, sizes, pose and density of a procedural object

    # Lift tests from the prior
    TRIAL = (14,)  # round, chunk: attempts
    FRESH_TRIAL = (8, 0)  # round, chunk: attempts until enough succeed
    FRESH_PAIR = (8, 1)  # (): failures that are shown, cameras, noise

    # Posterior, plans, benchmark
    PLAN = (15,)  # (): a plan
    BENCHMARK_SCENE = (16,)  # scene: scale, pose, nuisances, camera, noise
    BENCHMARK_SEARCH = (17,)  # scene: what strategies draw
    STATED_POSE = (31,)  # (): planes tried for the table where the camera's pose says it is
    FIXED_HAND = (29,)  # round: scenes that fixed hands are tried in
    DIAGNOSED_PAIR = (18,)  # (): pairs of a data set that a posterior is judged by
    REFERENCE = (19,)  # (): random points of the diagnostics
    DIAGNOSED_PRIOR = (20,)  # pair: draws from the prior that stand for a posterior
    DIAGNOSED_RANK = (21,)  # pair: posterior draws that a truth is ranked among

    # Pictures
    RENDERED_NOISE = (22,)  # (): noise of a rendered image
    RENDERED_CAMERA = (23,)  # (): errors of its camera
    PRIOR_FIGURE = (24,)  # (): hands drawn in the figure of the prior
    SHEET = (25,)  # (): images on the sheet of a data set

    # Posteriors
    EVIDENCE = (26,)  # (): draws from the prior behind the constant of a posterior
    POSTERIOR_SAMPLE = (27,)  # (): draws from a posterior
    POSTERIOR_MODE = (28,)  # (): draws from the prior that the search for its mode starts at


def seed_sequence(seed: int, *path: Stream | int) -> np.random.SeedSequence:
    """The seed sequence at ``path`` below ``seed``."""
    steps = [step for part in path for step in (part.value if isinstance(part, Stream) else (part,))]
    return np.random.SeedSequence(entropy=seed, spawn_key=steps)


def generator(seed: int, *path: Stream | int) -> np.random.Generator:
    """A NumPy generator for the stream at ``path`` below ``seed``."""
    return np.random.Generator(np.random.PCG64DXSM(seed_sequence(seed, *path)))


def generator_of(seed: int | np.random.Generator, stream: Stream) -> np.random.Generator:
    """The generator that a caller hands in as it is, or the one of a stream below a seed.

    Raises:
        InvalidConfigurationError: A negative seed.
    """
    if isinstance(seed, np.random.Generator):
        return seed
    if seed < 0:
        raise InvalidConfigurationError(f"the seed must be at least 0, got {seed}")
    return generator(seed, stream)


def torch_generator(seed: int, *path: Stream | int, device: torch.device | str = "cpu") -> torch.Generator:
    """A torch generator for the stream at ``path`` below ``seed``."""
    return _torch_generator(seed_sequence(seed, *path), device)


def torch_child(rng: np.random.Generator, device: torch.device | str = "cpu") -> torch.Generator:
    """A torch generator for the next child of a NumPy generator's stream, from which nothing is drawn.

    The k-th call gives the stream at the path of ``rng`` and k, however many numbers were drawn from ``rng`` before.
    """
    return _torch_generator(rng.spawn(1)[0].bit_generator.seed_seq, device)


def _torch_generator(sequence: ISeedSequence, device: torch.device | str) -> torch.Generator:
    return torch.Generator(device=device).manual_seed(int(sequence.generate_state(1, np.uint64)[0]))
