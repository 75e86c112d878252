"""The priors of the nuisances: domain randomisation of the lift test and of the camera (paper, section 4.1).

The paper fixes the form: uniform, +-2 %, for what is hard to measure, and for the orientation of the camera
eta ~ N(0, diag(0.002, 0.01, 0.002)^2) rad, mapped to SO(3) by the exponential map. It leaves the nominal values open.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import CANONICAL_POSITION
from bayesgrasp.prior.ranges import Interval, check_interval, uniform
from bayesgrasp.types import CameraNuisances, Nuisances


@dataclass(frozen=True)
class NuisancePrior:
    """Frictions and mass in the lift test; independent, uniform.

    The paper names the two frictions as nuisances and +-2 % as their error, about values that it does not state
    (`paper` is that, about the middle of the intervals here). The default is wider, since nobody knows the
    friction of an object's surface to 2 %; and since masses of scaled objects are catalogue values, they vary too.

    Attributes:
        lateral_friction: Interval of the Coulomb coefficient.
        spinning_friction: Interval of the torsional coefficient, metres: about the radius of a fingertip's contact.
        mass_factor: Interval of the true mass over the catalogue's.

    Raises:
        InvalidConfigurationError: An interval is reversed, not finite, or starts at a negative (mass: zero) value.
    """

    lateral_friction: Interval = (0.6, 1.0)
    spinning_friction: Interval = (0.002, 0.006)
    mass_factor: Interval = (0.9, 1.1)

    def __post_init__(self) -> None:
        check_interval("lateral_friction", self.lateral_friction, minimum=0.0)
        check_interval("spinning_friction", self.spinning_friction, minimum=0.0)
        check_interval("mass_factor", self.mass_factor, minimum=1e-3)

    @staticmethod
    def paper() -> NuisancePrior:
        """The paper's +-2 % about 0.8 and 4 mm, with the catalogue's masses."""
        return NuisancePrior(_around(0.8, 0.02), _around(0.004, 0.02), (1.0, 1.0))

    def sample(self, n: int, rng: np.random.Generator) -> Nuisances:
        """Nuisances of length n."""
        return Nuisances(
            lateral_friction=uniform(rng, self.lateral_friction, n),
            spinning_friction=uniform(rng, self.spinning_friction, n),
            mass_factor=uniform(rng, self.mass_factor, n),
        )


@dataclass(frozen=True)
class CameraPrior:
    """Where the camera really stands, how it is turned, and what it really measures.

    Attributes:
        position: Nominal position in the world frame, metres (default: that of `canonical_camera`).
        near, far: Nominal range of the sensor, metres: a Kinect v1 sees from about 0.45 to 4 m.
        relative_error: Half-width of the uniform errors: of each coordinate, of near, of far and of the field of view.
            A coordinate that is nominally 0 has no error.
        rotation_deviation: Standard deviations of the rotation vector in the camera frame, radians.

    Raises:
        InvalidConfigurationError: A value is not finite, near >= far, an error outside [0, 1), a negative deviation.
    """

    position: tuple[float, float, float] = CANONICAL_POSITION
    near: float = 0.45
    far: float = 4.0
    relative_error: float = 0.02
    rotation_deviation: tuple[float, float, float] = (0.002, 0.01, 0.002)

    def __post_init__(self) -> None:
        if not all(math.isfinite(value) for value in self.position):
            raise InvalidConfigurationError(f"position must be three finite numbers, metres, got {self.position}")
        if not (math.isfinite(self.far) and 0 < self.near < self.far):
            raise InvalidConfigurationError(f"the range must be 0 < near < far, finite; got {self.near} and {self.far}")
        if not 0 <= self.relative_error < 1:
            raise InvalidConfigurationError(f"relative_error must be in [0, 1), got {self.relative_error}")
        if not all(math.isfinite(value) and value >= 0 for value in self.rotation_deviation):
            raise InvalidConfigurationError(
                f"rotation_deviation must be three finite numbers >= 0, radians, got {self.rotation_deviation}"
            )

    def sample(self, n: int, rng: np.random.Generator) -> CameraNuisances:
        """Camera nuisances of length n."""
        errors = rng.uniform(-self.relative_error, self.relative_error, (n, 3))
        return CameraNuisances(
            position_offset=(errors * np.array(self.position)).astype(np.float32),
            rotation_vector=rng.normal(0.0, self.rotation_deviation, (n, 3)).astype(np.float32),
            near=uniform(rng, _around(self.near, self.relative_error), n),
            far=uniform(rng, _around(self.far, self.relative_error), n),
            field_of_view_factor=uniform(rng, _around(1.0, self.relative_error), n),
        )


def _around(value: float, relative_error: float) -> Interval:
    return value * (1 - relative_error), value * (1 + relative_error)
