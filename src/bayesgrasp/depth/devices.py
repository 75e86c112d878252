"""The kinds of depth sensor behind one interface: `DepthSensor` casts the rays, a device makes a measurement of them.

A device first senses the bare table everywhere, then, around the object, matches pixels to surfaces. Between the two
steps of matching the sensor asks whether a point is seen from the device's second eye: the projector of a Kinect
(`KinectConfig`), or the other camera of a stereo pair (`StereoConfig`).
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, Int32

from bayesgrasp.depth import kinect_kernels as kinect
from bayesgrasp.depth import stereo_kernels as stereo
from bayesgrasp.depth.frame import Frame, Lattices, Matches, ObjectRegion, Pixels
from bayesgrasp.depth.kinect import KinectConfig
from bayesgrasp.depth.match_kernels import REACH
from bayesgrasp.depth.stereo import StereoConfig

SensorConfig = KinectConfig | StereoConfig
Blocked = Int32[np.ndarray, "rays"]
"""By ray to the second eye: at least 0 where it met the object."""


@runtime_checkable
class Device(Protocol):
    """How a kind of sensor measures.

    Attributes:
        margin: Pixels beside the object and its shadow that matching may reach.
        shadow: Whether the second eye matters.
        steepest: Up to this tilt the bare table needs no care beyond `sense_table`, radians.
    """

    margin: int
    shadow: bool
    steepest: float

    def noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> Lattices:
        """Lattices over an image of a shape."""

    def local_noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> Float32[np.ndarray, "layers a b"]:
        """Lattices over a region of a shape."""

    def sense_table(self, frame: Frame, pixels: Pixels) -> None:
        """Write the bare table."""

    def match(self, frame: Frame, around: ObjectRegion, pixels: Pixels) -> Matches:
        """What pixels are matched to, and rays to the second eye."""

    def sense_matches(
        self, frame: Frame, around: ObjectRegion, pixels: Pixels, matches: Matches, blocked: Blocked
    ) -> None:
        """Overwrite matched pixels."""


class StructuredLight:
    """A projector beside a camera (`kinect_kernels`)."""

    def __init__(self, config: KinectConfig) -> None:
        self.constants = config.constants
        self.margin = REACH + self.constants.half_window
        self.shadow, self.steepest = config.shadow, config.grazing_start

    def noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> Lattices:
        """Of the measured depth."""
        return (lattice(rng, self.constants.noise_pitch, shape),)

    def local_noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> Float32[np.ndarray, "layers a b"]:
        """Of the place of edges, both ways, and of missing returns."""
        return lattice(rng, self.constants.noise_pitch, shape, layers=3)

    def sense_table(self, frame: Frame, pixels: Pixels) -> None:
        """See `Device`."""
        kinect.sense_table(frame, pixels, self.constants)

    def match(self, frame: Frame, around: ObjectRegion, pixels: Pixels) -> Matches:
        """See `Device`."""
        if not self.shadow:  # then the projector sees everything
            around = around._replace(hidden=np.zeros_like(around.hidden))
        matches: Matches = kinect.match(frame, around, pixels, self.constants)
        return matches

    def sense_matches(
        self, frame: Frame, around: ObjectRegion, pixels: Pixels, matches: Matches, blocked: Blocked
    ) -> None:
        """See `Device`."""
        kinect.sense_matches(frame, around, pixels, self.constants, matches, blocked)


class StereoPair:
    """Two cameras (`stereo_kernels`)."""

    shadow = True
    steepest = np.pi / 2

    def __init__(self, config: StereoConfig) -> None:
        self.constants = config.constants
        self.margin = REACH + self.constants.half_window

    def noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> Lattices:
        """Of the measured disparity, and of texture."""
        pitches = (self.constants.noise_pitch, self.constants.texture_pitch)
        return tuple(lattice(rng, pitch, shape) for pitch in pitches)

    def local_noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> Float32[np.ndarray, "layers a b"]:
        """Of the place of edges, and of the borders of holes."""
        return lattice(rng, self.constants.noise_pitch, shape, layers=2)

    def sense_table(self, frame: Frame, pixels: Pixels) -> None:
        """See `Device`."""
        stereo.sense_table(frame, pixels, self.constants)

    def match(self, frame: Frame, around: ObjectRegion, pixels: Pixels) -> Matches:
        """See `Device`."""
        matches: Matches = stereo.match(frame, around, pixels, self.constants)
        return matches

    def sense_matches(
        self, frame: Frame, around: ObjectRegion, pixels: Pixels, matches: Matches, blocked: Blocked
    ) -> None:
        """See `Device`."""
        stereo.sense_matches(frame, pixels, self.constants, matches, blocked)


def device_of(config: SensorConfig) -> Device:
    """The device that a configuration describes."""
    return StereoPair(config) if isinstance(config, StereoConfig) else StructuredLight(config)


def lattice(
    rng: np.random.Generator, pitch: int, shape: tuple[int, ...], layers: int | None = None
) -> Float32[np.ndarray, "*layers h w"]:
    """Independent standard normal numbers, one every `pitch` pixels, enough to interpolate at every pixel."""
    size = (shape[0] // pitch + 2, shape[1] // pitch + 2)
    return rng.standard_normal(size if layers is None else (layers, *size), dtype=np.float32)
