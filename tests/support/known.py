"""A posterior that is known: Gaussian in position and rotation vector about a noisy reading; exact, wide or narrow."""

from functools import lru_cache

import numpy as np
import torch

from bayesgrasp.geometry import so3
from bayesgrasp.types import Hands

TRUTHS, DRAWS = 500, 100
SPREADS = {"exact": 1.0, "wide": 1.6, "narrow": 0.6}


@lru_cache
def draw(spread: float, seed: int = 0) -> tuple[Hands, Hands, np.ndarray, np.ndarray]:
    """Truths, posterior draws, and the log-densities of both, for a posterior with its deviations times `spread`.

    The reading is the middle of the posterior and the truth a draw from the exact one (spread 1).
    """
    rng = np.random.default_rng(seed)
    truth = rng.standard_normal((TRUTHS, 1, 6))
    draws = spread * rng.standard_normal((TRUTHS, DRAWS, 6))
    center = rng.standard_normal((TRUTHS, 1, 6))
    log_density = [-0.5 * np.sum((x / spread) ** 2, -1) for x in (truth, draws)]
    types = rng.integers(0, 3, (TRUTHS, 1 + DRAWS))
    hands = _hands(np.concatenate([truth, draws], 1), center, types)
    return hands[:, 0], hands[:, 1:], log_density[0][:, 0], log_density[1]


def _hands(noise: np.ndarray, center: np.ndarray, types: np.ndarray) -> Hands:
    position = torch.from_numpy(0.05 * center[..., :3] + 0.02 * noise[..., :3])
    turn = so3.exp(torch.from_numpy(0.2 * center[..., 3:])) @ so3.exp(torch.from_numpy(0.3 * noise[..., 3:]))
    down = torch.tensor([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]], dtype=torch.float64)
    return Hands(position, down @ turn, torch.from_numpy(types))
