"""Departures from the world that the model was trained in, one at a time.

A shift changes what a scene really is, after everything was drawn: the same objects, poses, cameras and random numbers
meet every shift, so results with and without it are pairs. The planner is not told. Only where a shift changes what a
strategy looks at does it choose another grasp: the image (sensor, scale), or, for strategies that know the object, its
size and friction. Elsewhere the very same grasp is executed again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from bayesgrasp.depth.devices import SensorConfig
from bayesgrasp.depth.kinect import KinectConfig
from bayesgrasp.depth.stereo import StereoConfig
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.lift.lift_config import EngineName, LiftTestConfig
from bayesgrasp.prior.nuisance import NuisancePrior
from bayesgrasp.prior.ranges import Interval
from bayesgrasp.types import Nuisances, Scenes


@dataclass(frozen=True)
class Shift:
    """One departure.

    Attributes:
        name: As the command line takes it.
        engine: Physics of the lift test.
        mass: Factor on every mass, beyond the drawn one.
        friction: Both frictions, as a place in the intervals of their prior, from 0 (lowest) to 1 (highest); None for
            drawn ones.
        sensor: What takes the image.
        scale: Size of every object relative to its mesh; None for the drawn one.

    Raises:
        InvalidConfigurationError: A value outside its range.
    """

    name: str
    engine: EngineName = "mujoco"
    mass: float = 1.0
    friction: float | None = None
    sensor: Literal["kinect", "stereo"] = "kinect"
    scale: float | None = None

    def __post_init__(self) -> None:
        scale = 1.0 if self.scale is None else self.scale
        if not (0 < self.mass < math.inf and 0 < scale < math.inf):
            raise InvalidConfigurationError(f"mass and scale of a shift must be positive numbers, got {self}")
        if self.friction is not None and not 0 <= self.friction <= 1:
            raise InvalidConfigurationError(f"friction of a shift must be in [0, 1], got {self.friction}")

    @property
    def changes_image(self) -> bool:
        """Whether the depth image is another one."""
        return self.scale is not None or self.sensor != "kinect"

    @property
    def changes_object(self) -> bool:
        """Whether what full observation shows is something else: size or friction."""
        return self.scale is not None or self.friction is not None

    def scenes(self, drawn: Scenes) -> Scenes:
        """What really stands on the table."""
        return drawn if self.scale is None else replace(drawn, scale=np.full_like(drawn.scale, self.scale))

    def nuisances(self, drawn: Nuisances, prior: NuisancePrior) -> Nuisances:
        """What frictions and masses really are."""
        moved = replace(drawn, mass_factor=drawn.mass_factor * np.float32(self.mass))
        if self.friction is None:
            return moved
        return replace(
            moved,
            lateral_friction=np.full_like(drawn.lateral_friction, _at(prior.lateral_friction, self.friction)),
            spinning_friction=np.full_like(drawn.spinning_friction, _at(prior.spinning_friction, self.friction)),
        )

    @property
    def sensor_config(self) -> SensorConfig:
        """Of the sensor that takes the image."""
        return StereoConfig() if self.sensor == "stereo" else KinectConfig()

    @property
    def lift_test_config(self) -> LiftTestConfig:
        """Of the lift test that judges."""
        return LiftTestConfig(engine=self.engine)


NONE = Shift("none")
SHIFTS: dict[str, Shift] = {
    shift.name: shift
    for shift in (
        NONE,
        Shift("pybullet", engine="pybullet"),
        Shift("mass-0.7", mass=0.7),
        Shift("mass-1.3", mass=1.3),
        Shift("friction-low", friction=0.0),
        Shift("friction-high", friction=1.0),
        Shift("stereo", sensor="stereo"),
        Shift("scale-0.8", scale=0.8),
        Shift("scale-1.2", scale=1.2),
    )
}
"""The scales, and most of the masses, lie outside their priors, which are 0.9 to 1.1 for both."""


def find_shift(name: str, engine: EngineName | None = None) -> Shift:
    """A shift by name, in another engine if one is given.

    Raises:
        InvalidConfigurationError: There is no such shift, or it is the other engine.
    """
    if name not in SHIFTS:
        raise InvalidConfigurationError(f"there is no shift '{name}'; choose from {', '.join(SHIFTS)}")
    shift = SHIFTS[name]
    if engine is None:
        return shift
    if shift.engine not in (NONE.engine, engine):
        raise InvalidConfigurationError(f"the shift '{name}' runs in {shift.engine}: leave out --engine {engine}")
    return replace(shift, engine=engine)


def _at(interval: Interval, place: float) -> np.float32:
    low, high = interval
    return np.float32(low + place * (high - low))
