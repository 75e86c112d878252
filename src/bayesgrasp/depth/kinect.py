"""The Kinect v1 as a structured-light sensor: its published laws, and the constants of the model.

The projector stands `baseline` beside the infrared camera. A point at depth z (m) is matched at a disparity of
f b / z px, which the device reports in steps of 1/8 px as an 11-bit number kd, so that it only ever returns the depths

    z = 348 / (1091.5 - kd),    one step apart by z^2 / 348.

The model works in units of that step, q = 348 / z. The spread of a measured depth was published by Nguyen, Izadi and
Lovell ("Modeling Kinect sensor noise for improved 3D reconstruction and tracking", 3DIMPVT 2012), with th the angle
between the surface normal and the ray:

    axial    sigma_z = 0.0012 + 0.0019 (z - 0.4)^2  [+ 0.0001 / sqrt(z) * th^2 / (pi/2 - th)^2  beyond 60 degrees]   m
    lateral  sigma_l = 0.8 + 0.035 th / (pi/2 - th)                                                                px

They hold for what the device returns, steps included. A rounded value has the variance of the unrounded one plus 1/12
step^2, so the noise added before rounding has that much less.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, no_type_check

import numpy as np
from numba import njit

from bayesgrasp.errors import InvalidConfigurationError

DEPTH_CONSTANT = 348.0
"""Metres times steps: f b * 8 for f = 580 px and b = 7.5 cm."""
STEPS_PER_PIXEL = 8.0
DISPARITY_OFFSET = 1091.5
COS_TILT_START = np.cos(np.deg2rad(60.0))
COS_STEEPEST = np.cos(np.deg2rad(85.0))
"""Both laws diverge at 90 degrees; they are held constant from 85 on."""


class KinectConstants(NamedTuple):
    """The configuration as plain numbers, as the compiled kernels take it; lengths in pixels, disparities in steps."""

    half_window: int
    min_support: float
    same_surface: float
    edge_step: float
    noise_pitch: int
    axial_gain: float
    lateral_gain: float
    grazing_start: float
    grazing_end: float


@dataclass(frozen=True)
class KinectConfig:
    """Constants of the sensor model.

    Attributes:
        baseline: From the infrared camera to the projector along the camera's x axis, metres. Seen from the front, the
            device has its projector on the left and its infrared camera on the right, so from behind the camera the
            projector is on the right (+x), and shadows fall to the left of objects. Negative for a mirrored device.
        window: Side of the square correlation window, px; odd.
        min_support: Share of the window that must lie on the pixel's own surface for it to be matched. 0.36 is 3.2 px
            of a rod in a window of 9, and a little more than a quarter, the share of a square corner.
        same_surface: Disparities of one surface within a window differ by less than this, px.
        edge_step: A jump of disparity by more than this is an edge, px; lateral noise acts on edges alone, since on a
            surface its effect is part of the measured axial law.
        noise_pitch: Spacing of the random numbers that noise is interpolated from, px. Neighbouring windows overlap, so
            neighbouring errors are alike up to about the size of a window, twice this pitch.
        axial_gain, lateral_gain: Factors on the published standard deviations; 0 switches a noise off.
        grazing_start, grazing_end: Tilts between which the share of missing returns grows from 0 to 1, radians.
        shadow: Whether points that the projector does not see are missing.

    Raises:
        InvalidConfigurationError: A value outside its range.
    """

    baseline: float = 0.075
    window: int = 9
    min_support: float = 0.36
    same_surface: float = 1.0
    edge_step: float = 0.5
    noise_pitch: int = 4
    axial_gain: float = 1.0
    lateral_gain: float = 1.0
    grazing_start: float = float(np.deg2rad(70.0))
    grazing_end: float = float(np.deg2rad(85.0))
    shadow: bool = True

    def __post_init__(self) -> None:
        rules = {
            "baseline must be finite": np.isfinite(self.baseline),
            "window must be odd, from 1 to 15 px": self.window in range(1, 16, 2),
            "min_support must be in [0, 1]": 0 <= self.min_support <= 1,
            "same_surface and edge_step must be positive": self.same_surface > 0 and self.edge_step > 0,
            "noise_pitch must be from 1 to 32 px": 1 <= self.noise_pitch <= 32,
            "axial_gain and lateral_gain must be from 0 to 10": min(self.gains) >= 0 and max(self.gains) <= 10,
            "grazing_start must be below grazing_end, both in [0, pi/2]": 0
            <= self.grazing_start
            < self.grazing_end
            <= np.pi / 2,
        }
        broken = [rule for rule, holds in rules.items() if not holds]
        if broken:
            raise InvalidConfigurationError(f"{'; '.join(broken)}; got {self}")

    @property
    def gains(self) -> tuple[float, float]:
        """The factors on the axial and on the lateral noise."""
        return self.axial_gain, self.lateral_gain

    @property
    def constants(self) -> KinectConstants:
        """The configuration as the compiled kernels take it."""
        return KinectConstants(
            half_window=self.window // 2,
            min_support=self.min_support,
            same_surface=self.same_surface * STEPS_PER_PIXEL,
            edge_step=self.edge_step * STEPS_PER_PIXEL,
            noise_pitch=self.noise_pitch,
            axial_gain=self.axial_gain,
            lateral_gain=self.lateral_gain,
            grazing_start=self.grazing_start,
            grazing_end=self.grazing_end,
        )


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def axial_sigma(depth, steep):
    """Published standard deviation of a returned depth, metres; `steep` is the part of it that `steep_sigma` gives."""
    beyond = depth - 0.4
    return 0.0012 + 0.0019 * beyond * beyond + steep


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def steep_sigma(disparity, cosine):
    """The part of the axial deviation (m) that only surfaces tilted beyond 60 degrees have.

    Of a disparity q in steps and the cosine of the tilt, which are what the loops have: 1 / sqrt(z) = sqrt(q / 348).
    """
    if cosine >= COS_TILT_START or disparity <= 0:
        return 0.0
    tilt = np.arccos(max(cosine, COS_STEEPEST))
    return 1e-4 * np.sqrt(disparity / DEPTH_CONSTANT) * (tilt / (np.pi / 2 - tilt)) ** 2


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def lateral_sigma(tilt):
    """Published standard deviation of the place of an edge, pixels; of a tilt below 90 degrees, radians."""
    return 0.8 + 0.035 * tilt / (np.pi / 2 - tilt)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def quantised(disparity):
    """The disparity, in steps, that stands for all disparities of its step: kd is a whole number and 1091.5 is not."""
    return np.floor(disparity) + 0.5
