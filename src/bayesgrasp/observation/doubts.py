"""What in an image speaks against one object that stands on an empty table, which is all that the simulator knows.

A camera from the side sees an object down to where it stands, or, if it is round, down to a fraction of its height: a
ball of radius r is seen to r (1 - cos e) from an elevation e. What ends far above the table floats: something holds it,
or the camera is not where it is said to be. What stands beside the object, or hangs over it as another arm does, may be
touched by the hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.observation.surface import Surface, heights


@dataclass(frozen=True)
class DoubtConfig:
    """When to doubt.

    Attributes:
        steepest: From above this elevation a camera need not see where an object stands, radians.
        floating: An object whose lowest point seen is higher than this share of its height floats.
        overhang: But not if that point is lower than this, metres.
        apart: Pieces closer than this to the object belong to it, metres.
        neighbourhood: Other things closer than this are warned of, metres.
        over: So is what is seen over the object and is so much higher than its top, metres.
    """

    steepest: float = 1.1
    floating: float = 0.5
    overhang: float = 0.035
    apart: float = 0.02
    neighbourhood: float = 0.25
    over: float = 0.03

    def __post_init__(self) -> None:
        if (
            min(self.overhang, self.apart, self.over) < 0
            or not 0 < self.floating < 1
            or self.neighbourhood < self.apart
        ):
            raise InvalidConfigurationError(
                "need overhang, apart and over >= 0, floating between 0 and 1, and neighbourhood >= apart"
            )


def doubts(surface: Surface, camera_to_world: Float64[np.ndarray, "4 4"], config: DoubtConfig) -> tuple[str, ...]:
    """What speaks against one object that stands on an empty table, in words.

    Args:
        surface: With an object.
        camera_to_world: Pose of the camera that saw it.
        config: When to doubt.
    """
    found = []
    elevation = np.arcsin(np.clip(-camera_to_world[2, 2], -1, 1))
    lowest, top = np.percentile(heights(surface.item_points, surface.table), (2, 98))
    if elevation < config.steepest and lowest > max(config.floating * top, config.overhang):
        found.append(
            f"the object seems to float: its lowest point seen is {100 * lowest:.0f} cm above the table, its top "
            f"{100 * top:.0f} cm; something holds it, or the camera is not where it is said to be"
        )
    gap = nearest_other(surface, config.apart)
    if gap < config.neighbourhood:
        found.append(
            f"another thing stands {100 * gap:.0f} cm from the object: the model knows single objects, and the hand "
            "may touch the other one"
        )
    above = _least_height_over(surface, config.apart) - top
    if above > config.over:
        found.append(f"something hangs {100 * above:.0f} cm over the object: the hand may touch it")
    return tuple(found)


def _least_height_over(surface: Surface, apart: float) -> float:
    """Least height of the pieces that are seen over the object or at its side, metres; -inf where there is none."""
    numbers = surface.others[surface.others > 0]
    if len(numbers) == 0:
        return -np.inf
    points = surface.points[surface.others > 0]
    near = np.unique(numbers[cKDTree(surface.item_points[:, :2]).query(points[:, :2])[0] < apart])
    height = heights(points, surface.table)
    return float(max((np.percentile(height[numbers == number], 2) for number in near), default=-np.inf))


def nearest_other(surface: Surface, apart: float) -> float:
    """Least distance along the table between the object and a piece that does not belong to it, metres; else inf."""
    tree = cKDTree(surface.item_points[:, :2])
    numbers = surface.others[surface.others > 0]
    distance = tree.query(surface.points[surface.others > 0][:, :2])[0]
    gaps = np.full(surface.others.max(initial=0) + 1, np.inf)
    np.minimum.at(gaps, numbers, distance)
    return float(gaps[gaps >= apart].min(initial=np.inf))
