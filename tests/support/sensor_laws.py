"""The published laws of the sensors, written a second time, for the compiled ones and for images to be held against.

Depths in metres, tilts (between a surface's normal and the ray) in radians.
"""

import numpy as np

from bayesgrasp.depth.stereo import StereoConfig

Number = float | np.ndarray

STEEPEST_TILT = np.deg2rad(85.0)


def axial_sigma(depth: Number, tilt: Number) -> np.ndarray:
    """Nguyen et al. 2012: standard deviation of a Kinect's depth, metres."""
    th = np.minimum(tilt, STEEPEST_TILT)
    steep = np.where(th > np.deg2rad(60.0), 1e-4 / np.sqrt(depth) * th**2 / (np.pi / 2 - th) ** 2, 0.0)
    return np.asarray(0.0012 + 0.0019 * (depth - 0.4) ** 2 + steep)


def lateral_sigma(tilt: Number) -> np.ndarray:
    """The same source: standard deviation of the place of an edge, pixels."""
    th = np.minimum(tilt, STEEPEST_TILT)
    return np.asarray(0.8 + 0.035 * th / (np.pi / 2 - th))


def depth_step(depth: Number) -> Number:
    """Distance between neighbouring depths that a Kinect can return, metres."""
    return depth**2 / 348.0


def quantise(depth: Number) -> np.ndarray:
    """The depth that a Kinect returns for a true depth, without noise."""
    return np.asarray(348.0 / (np.floor(348.0 / depth) + 0.5))


def stereo_sigma(config: StereoConfig, depth: float) -> float:
    """Standard deviation of a stereo pair's depth where texture is average and the surface faces the camera, metres."""
    return depth**2 * config.subpixel / (config.focal_length * abs(config.baseline))


def hidden_width(focal_length: float, baseline: float, near: float, far: float) -> float:
    """Width of what an edge at depth `near` hides from the second eye on a wall at depth `far`, pixels."""
    return focal_length * abs(baseline) * (1 / near - 1 / far)
