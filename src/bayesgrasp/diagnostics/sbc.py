"""Simulation-based calibration (Talts et al. 2018): ranks of the truth among posterior draws, one statistic at a time.

For any scalar statistic t(h), the rank of t(h*) among t of m posterior draws is uniform on 0..m if the posterior is
right. A hump in the middle means too wide, a bowl too narrow, a slope a bias. The statistics are those a person can
read: x, y, z, angle of the approach to the vertical, yaw of the closing direction, grasp type. Equal values (the type)
are ordered at random, which keeps the rank uniform.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy import stats

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.types import Hands


@dataclass(frozen=True)
class Ranks:
    """Ranks of truths for one statistic.

    Attributes:
        ranks: Of each truth, 0..draws.
        draws: Number m of posterior draws behind each rank.
    """

    ranks: Int[np.ndarray, "n"]
    draws: int

    @property
    def position(self) -> Float[np.ndarray, "n"]:
        """Ranks as numbers in (0, 1)."""
        return (self.ranks + 0.5) / (self.draws + 1)

    @property
    def p_value(self) -> float:
        """Of the Kolmogorov-Smirnov test of uniformity (slightly conservative, since ranks are discrete)."""
        return float(stats.kstest(self.position, "uniform").pvalue)

    @property
    def spread(self) -> float:
        """Standard deviation over that of a uniform variable: below 1 for too wide, above 1 for too narrow."""
        return float(self.position.std() * np.sqrt(12.0))  # a uniform variable on (0, 1) has a variance of 1/12

    @property
    def shift(self) -> float:
        """Mean minus 1/2."""
        return float(self.position.mean() - 0.5)

    def histogram(self, bins: int = 10) -> Int[np.ndarray, "{bins}"]:
        """Counts of ranks in equal bins."""
        return np.histogram(self.position, bins, (0.0, 1.0))[0]

    def to_dict(self) -> dict[str, object]:
        """As JSON-able data."""
        numbers = {"p_value": self.p_value, "spread": self.spread, "shift": self.shift, "draws": self.draws}
        return {**numbers, "count": len(self.ranks), "histogram": self.histogram().tolist()}


def statistics(hands: Hands) -> dict[str, np.ndarray]:
    """The scalar statistics of hands of any batch shape: metres, radians, type."""
    rotation = hands.rotation
    # Columns of R are the hand's axes in the world: x is the approach (down at tilt 0), y the closing direction.
    tilt = torch.acos((-rotation[..., 2, 0]).clamp(-1.0, 1.0))
    yaw = torch.atan2(rotation[..., 1, 1], rotation[..., 0, 1])
    x, y, z = hands.position.unbind(-1)
    values = {"x": x, "y": y, "z": z, "approach_angle": tilt, "yaw": yaw, "type": hands.grasp_type}
    return {name: value.detach().cpu().double().numpy() for name, value in values.items()}


def sbc_ranks(truth: Float[np.ndarray, "n"], draws: Float[np.ndarray, "n m"], rng: np.random.Generator) -> Ranks:
    """Ranks of truths among draws; ties in random order.

    Raises:
        InvalidConfigurationError: Nothing to rank.
    """
    if draws.size == 0:
        raise InvalidConfigurationError("ranks need at least one truth and at least one posterior draw each")
    below = (draws < truth[:, None]).sum(-1)
    ties = (draws == truth[:, None]).sum(-1)
    return Ranks(below + rng.integers(0, ties + 1), draws.shape[1])


def simulation_based_calibration(truth: Hands, draws: Hands, rng: np.random.Generator) -> Mapping[str, Ranks]:
    """Ranks for all statistics.

    Args:
        truth: (n,) hands that the observations come from.
        draws: (n, m) posterior draws.
        rng: Orders ties.
    """
    known, drawn = statistics(truth), statistics(draws)
    return {name: sbc_ranks(known[name], drawn[name], rng) for name in known}
