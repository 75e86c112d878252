"""Independent random streams that depend on the seed and on a path of integers, and on nothing else.

A stream is addressed, not drawn: ``generator(seed, 3, 7)`` is the same stream on any worker and in any order
(`numpy.random.SeedSequence`, spawn keys). Simulation draws from NumPy generators, learning from torch generators.
"""

import numpy as np
import torch


def seed_sequence(seed: int, *path: int) -> np.random.SeedSequence:
    """The seed sequence at ``path`` below ``seed``."""
    return np.random.SeedSequence(entropy=seed, spawn_key=path)


def generator(seed: int, *path: int) -> np.random.Generator:
    """A NumPy generator for the stream at ``path`` below ``seed``."""
    return np.random.Generator(np.random.PCG64DXSM(seed_sequence(seed, *path)))


def torch_generator(seed: int, *path: int, device: torch.device | str = "cpu") -> torch.Generator:
    """A torch generator for the stream at ``path`` below ``seed``."""
    state = int(seed_sequence(seed, *path).generate_state(1, np.uint64)[0])
    return torch.Generator(device=device).manual_seed(state)
