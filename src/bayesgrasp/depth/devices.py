"""The kinds of depth sensor behind one interface: `DepthSensor` casts the rays, a device makes a measurement of them.

A device first senses the bare table everywhere, then, around the object, matches pixels to surfaces. Between the two
steps of matching the sensor asks whether a point is seen from the device's second eye: the projector of a Kinect
(`KinectConfig`), or the other camera of a stereo pair (`StereoConfig`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, Float64, Int32, Int64

from bayesgrasp.depth import light_kernels as light
from bayesgrasp.depth import return_kernels as returns
from bayesgrasp.depth import stereo_kernels as stereo
from bayesgrasp.depth.kinect import KinectConfig
from bayesgrasp.depth.light_kernels import Matches
from bayesgrasp.depth.ray_kernels import Region, View
from bayesgrasp.depth.stereo import StereoConfig

SensorConfig = KinectConfig | StereoConfig
Lattices = tuple[Float32[np.ndarray, "..."], ...]


class Frame(NamedTuple):
    """What is measured in one image.

    Attributes:
        view: The camera in the object's frame.
        limits: Depths outside are not returned, metres.
        noise: Random lattices over the whole image, of the device's making.
    """

    view: View
    limits: tuple[float, float]
    noise: Lattices


class ObjectRegion(NamedTuple):
    """The neighbourhood of the object in an image.

    Attributes:
        planes: Of the mesh, see `MeshTree`.
        region: What is seen there.
        near: Columns of each row where there may be more than bare table.
        hidden: Columns of each row where the second eye may not see the table.
        noise: Random lattices over the region, of the device's making.
    """

    planes: Float64[np.ndarray, "f 4"]
    region: Region
    near: Int64[np.ndarray, "h 2"]
    hidden: Int64[np.ndarray, "h 2"]
    noise: Float32[np.ndarray, "layers a b"]


class Pixels(NamedTuple):
    """Rows and columns that are evaluated, and the image (float32, metres) that they are written to."""

    rows: Int64[np.ndarray, "r"]
    columns: Int64[np.ndarray, "c"]
    image: Float32[np.ndarray, "r c"]


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

    def sense_table(self, frame: Frame, pixels: Pixels, width: int) -> None:
        """Write the bare table; `width` of the whole image, px."""

    def match(self, frame: Frame, around: ObjectRegion, pixels: Pixels) -> Matches:
        """What pixels are matched to, and rays to the second eye."""

    def sense_matches(
        self,
        frame: Frame,
        around: ObjectRegion,
        matches: Matches,
        blocked: Int32[np.ndarray, "rays"],
        pixels: Pixels,
        width: int,
    ) -> None:
        """Overwrite matched pixels; `blocked` is at least 0 for rays that met the object."""


class StructuredLight:
    """A projector beside a camera (`light_kernels`, `return_kernels`)."""

    def __init__(self, config: KinectConfig) -> None:
        self.constants = config.constants
        self.margin = light.REACH + self.constants.half_window
        self.shadow, self.steepest = config.shadow, config.grazing_start

    def noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> Lattices:
        """Of the measured depth."""
        return (lattice(rng, self.constants.noise_pitch, shape),)

    def local_noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> Float32[np.ndarray, "layers a b"]:
        """Of the place of edges, both ways, and of missing returns."""
        return lattice(rng, self.constants.noise_pitch, shape, layers=3)

    def sense_table(self, frame: Frame, pixels: Pixels, width: int) -> None:
        """See `Device`."""
        returns.sense_table(frame.view, self.constants, frame.noise[0], *frame.limits, *pixels)

    def match(self, frame: Frame, around: ObjectRegion, pixels: Pixels) -> Matches:
        """See `Device`."""
        if not self.shadow:
            around = around._replace(hidden=np.zeros_like(around.hidden))
        return _matched(light.match, self.constants, frame, around, pixels)

    def sense_matches(
        self,
        frame: Frame,
        around: ObjectRegion,
        matches: Matches,
        blocked: Int32[np.ndarray, "rays"],
        pixels: Pixels,
        width: int,
    ) -> None:
        """See `Device`."""
        corner = (around.region.row, around.region.column)
        grazing = around.noise[2]
        returns.sense_matches(matches, blocked, self.constants, frame.noise[0], grazing, corner, *frame.limits, *pixels)


class StereoPair:
    """Two cameras (`stereo_kernels`)."""

    shadow = True
    steepest = np.pi / 2

    def __init__(self, config: StereoConfig) -> None:
        self.constants = config.constants
        self.margin = light.REACH + self.constants.half_window

    def noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> Lattices:
        """Of the measured disparity, and of texture."""
        pitches = (self.constants.noise_pitch, self.constants.texture_pitch)
        return tuple(lattice(rng, pitch, shape) for pitch in pitches)

    def local_noise(self, rng: np.random.Generator, shape: tuple[int, int]) -> Float32[np.ndarray, "layers a b"]:
        """Of the place of edges, and of the borders of holes."""
        return lattice(rng, self.constants.noise_pitch, shape, layers=2)

    def sense_table(self, frame: Frame, pixels: Pixels, width: int) -> None:
        """See `Device`."""
        stereo.sense_table(frame.view, self.constants, *frame.noise, width, *frame.limits, *pixels)

    def match(self, frame: Frame, around: ObjectRegion, pixels: Pixels) -> Matches:
        """See `Device`."""
        return _matched(stereo.match, self.constants, frame, around, pixels)

    def sense_matches(
        self,
        frame: Frame,
        around: ObjectRegion,
        matches: Matches,
        blocked: Int32[np.ndarray, "rays"],
        pixels: Pixels,
        width: int,
    ) -> None:
        """See `Device`."""
        stereo.sense_matches(matches, blocked, self.constants, *frame.noise, width, *frame.limits, *pixels)


def device_of(config: SensorConfig) -> Device:
    """The device that a configuration describes."""
    return StereoPair(config) if isinstance(config, StereoConfig) else StructuredLight(config)


def _matched(
    kernel: Callable[..., Matches], constants: object, frame: Frame, around: ObjectRegion, pixels: Pixels
) -> Matches:
    """What a device's kernel matches pixels to."""
    planes, region, near, hidden, noise = around
    return kernel(frame.view, planes, region, noise, constants, near, hidden, pixels.rows, pixels.columns)


def lattice(
    rng: np.random.Generator, pitch: int, shape: tuple[int, ...], layers: int | None = None
) -> Float32[np.ndarray, "*layers h w"]:
    """Independent standard normal numbers, one every `pitch` pixels, enough to interpolate at every pixel."""
    size = (shape[0] // pitch + 2, shape[1] // pitch + 2)
    return rng.standard_normal(size if layers is None else (layers, *size), dtype=np.float32)
