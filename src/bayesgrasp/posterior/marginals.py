"""Marginals of a posterior over hands, from its draws: what can be looked at.

Positions and approach directions are counted in cells; a density is the share of the draws in a cell over the cell's
size, so each integrates to 1 (draws outside the range of a histogram are left out of it). The sphere of directions is
cut into cells of equal area: bands of equal height times sectors of equal azimuth (Archimedes), 4 pi / (bands sectors)
steradians each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.box import Box
from bayesgrasp.types import GraspType, Hands


@dataclass(frozen=True)
class Histogram:
    """Density of one coordinate.

    Attributes:
        edges: Of the cells, metres.
        density: In each cell, 1 / m.
    """

    edges: Float64[np.ndarray, "edges"]
    density: Float64[np.ndarray, "cells"]


@dataclass(frozen=True)
class SphereHistogram:
    """Density of a direction.

    Attributes:
        height: Edges of the bands: the z component of the direction, from -1 to 1.
        azimuth: Edges of the sectors: its angle about z, from -pi to pi, radians.
        density: In each band and sector, 1 / sr.
    """

    height: Float64[np.ndarray, "height_edges"]
    azimuth: Float64[np.ndarray, "azimuth_edges"]
    density: Float64[np.ndarray, "bands sectors"]


@dataclass(frozen=True)
class Marginals:
    """Marginals of p(h | S=1, i).

    Attributes:
        grasp_type: Probability of each grasp type, in the order of `GraspType`.
        x, y, z: Density of the palm's position, world frame.
        approach: Density of the direction of the hand's x axis, world frame.
    """

    grasp_type: Float64[np.ndarray, "types"]
    x: Histogram
    y: Histogram
    z: Histogram
    approach: SphereHistogram

    def to_dict(self) -> dict[str, Any]:
        """As plain data."""
        axes = {name: getattr(self, name) for name in "xyz"}
        approach = {name: getattr(self.approach, name).tolist() for name in ("height", "azimuth", "density")}
        return {
            "grasp_type": {t.name.lower(): float(self.grasp_type[t]) for t in GraspType},
            **{k: {"edges": h.edges.tolist(), "density": h.density.tolist()} for k, h in axes.items()},
            "approach": approach,
        }


def marginals_of(hands: Hands, box: Box, bins: int = 20) -> Marginals:
    """Marginals of equally weighted draws.

    Args:
        hands: Draws, (n,), world frame.
        box: Range of the positions.
        bins: Cells of each coordinate; bands of directions, with twice as many sectors.

    Raises:
        InvalidConfigurationError: No draw, or no cell.
    """
    if len(hands.grasp_type) == 0 or bins < 1:
        raise InvalidConfigurationError(f"marginals need a draw and a cell, got {len(hands.grasp_type)} and {bins}")
    hands = hands.to("cpu")
    position = hands.position.double().numpy()
    x, y, z = (_histogram(position[:, axis], box.low[axis], box.high[axis], bins) for axis in range(3))
    counts = np.bincount(hands.grasp_type.numpy(), minlength=len(GraspType))
    return Marginals(counts / counts.sum(), x, y, z, _directions(hands.rotation[:, :, 0].double().numpy(), bins))


def _histogram(values: Float64[np.ndarray, "n"], low: float, high: float, bins: int) -> Histogram:
    edges = np.linspace(low, high, bins + 1)
    counts, _ = np.histogram(values, edges)
    return Histogram(edges, counts / max(int(counts.sum()), 1) / np.diff(edges))


def _directions(direction: Float64[np.ndarray, "n 3"], bands: int) -> SphereHistogram:
    height, azimuth = np.linspace(-1.0, 1.0, bands + 1), np.linspace(-math.pi, math.pi, 2 * bands + 1)
    # Rounding may leave a unit vector's component just outside [-1, 1].
    across = np.arctan2(direction[:, 1], direction[:, 0])
    counts, _, _ = np.histogram2d(direction[:, 2].clip(-1.0, 1.0), across, (height, azimuth))
    return SphereHistogram(height, azimuth, counts / counts.sum() / (4 * math.pi / counts.size))
