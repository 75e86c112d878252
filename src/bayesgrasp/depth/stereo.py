"""A stereo camera: its published laws, and the constants of the model.

Two infrared cameras stand side by side. A point at depth z (m) appears in the second one moved by a disparity

    d = f |b| / z px,

which block matching finds to a fraction of a pixel. The error of a depth therefore grows with its square:

    sigma_z = z^2 sigma_d / (f |b|)

(Keselman et al., "Intel RealSense stereoscopic depth cameras", CVPR workshops 2017; Grunnet-Jepsen, Sweetser, Woodfill,
"Tuning depth cameras for best performance", Intel 2018, by whom sigma_d is below 0.1 px on a well-textured surface).
The cameras of that family return d in steps of 1/32 px; the baseline here is that of their narrow model.

* Texture. The variance of a matched disparity is inversely proportional to the energy of the image's gradients within
  the window (Forstner and Pertl 1986; Okutomi and Kanade, "A multiple-baseline stereo", PAMI 1993). Here that energy is
  log-normal over the image and falls with cos^2 of the tilt, as the light on the surface does:

      sigma_d = subpixel * exp(-texture_spread * t) / cos(tilt),    t a smooth standard normal field.

  A match whose error would be above a limit has too little confidence and is rejected: blobs without depth.
* Edges. A window that straddles an edge matches the nearer surface even where its middle is on the farther one
  ("foreground fattening"; Scharstein and Szeliski, "A taxonomy and evaluation of dense two-frame stereo correspondence
  algorithms", IJCV 2002).
* Occlusion. What only one camera sees has no match; the left-right check rejects it. The band lies on that side of an
  object on which the reference camera stands, and so does a border of the image that the other camera does not see.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bayesgrasp.errors import InvalidConfigurationError


class StereoConstants(NamedTuple):
    """The configuration as plain numbers, as the compiled kernels take it; lengths and disparities in pixels.

    `depth_constant` is f |b| in px m, and `side` the sign of the baseline.
    """

    depth_constant: float
    side: float
    half_window: int
    min_support: float
    same_surface: float
    fattening: float
    fattening_spread: float
    noise_pitch: int
    texture_pitch: int
    subpixel: float
    step: float
    texture_spread: float
    weakest: float


@dataclass(frozen=True)
class StereoConfig:
    """Constants of the sensor model.

    Attributes:
        baseline: From the reference camera to the other one along its x axis, metres. Negative: the depth image is that
            of the right camera, and holes are to the right of objects, where a Kinect v1 has none.
        focal_length: By which disparities become depths, px.
        window: Side of the square block that is matched, px; odd.
        subpixel: Standard deviation of a disparity where texture is average and the surface faces the camera, px.
        step: Between neighbouring disparities, px.
        texture_spread: Standard deviation of the logarithm of that deviation over an image.
        weakest: A match is rejected where its deviation would be above this multiple of `subpixel`.
        fattening: Share of the window that a nearer surface needs to be matched, on average.
        fattening_spread: Standard deviation of that share along an edge.
        min_support: Share of the window that the pixel's own surface needs to be matched.
        same_surface: Disparities of one surface within a window differ by less than this, px.
        noise_pitch: Spacing of the random numbers that noise is interpolated from, px; see `KinectConfig`.
        texture_pitch: The same for texture; blobs are about twice as wide.

    Raises:
        InvalidConfigurationError: A value outside its range.
    """

    baseline: float = -0.055
    focal_length: float = 580.0
    window: int = 9
    subpixel: float = 0.08
    step: float = 1 / 32
    texture_spread: float = 0.5
    weakest: float = 3.2
    fattening: float = 0.3
    fattening_spread: float = 0.1
    min_support: float = 0.25
    same_surface: float = 1.0
    noise_pitch: int = 4
    texture_pitch: int = 10

    def __post_init__(self) -> None:
        rules = {
            "baseline must be finite and not 0": np.isfinite(self.baseline) and self.baseline != 0,
            "window must be odd, from 1 to 15 px": self.window in range(1, 16, 2),
            "focal_length, step, weakest and same_surface must be positive": min(
                self.focal_length, self.step, self.weakest, self.same_surface
            )
            > 0,
            "subpixel, texture_spread and fattening_spread must be from 0 to 10": 0
            <= min(self.subpixel, self.texture_spread, self.fattening_spread)
            <= max(self.subpixel, self.texture_spread, self.fattening_spread)
            <= 10,
            "fattening and min_support must be in [0, 1]": 0
            <= min(self.fattening, self.min_support)
            <= max(self.fattening, self.min_support)
            <= 1,
            "noise_pitch and texture_pitch must be from 1 to 32 px": 1
            <= min(self.noise_pitch, self.texture_pitch)
            <= max(self.noise_pitch, self.texture_pitch)
            <= 32,
        }
        broken = [rule for rule, holds in rules.items() if not holds]
        if broken:
            raise InvalidConfigurationError(f"{'; '.join(broken)}; got {self}")

    @property
    def constants(self) -> StereoConstants:
        """The configuration as the compiled kernels take it."""
        return StereoConstants(
            depth_constant=self.focal_length * abs(self.baseline),
            side=float(np.sign(self.baseline)),
            half_window=self.window // 2,
            min_support=self.min_support,
            same_surface=self.same_surface,
            fattening=self.fattening,
            fattening_spread=self.fattening_spread,
            noise_pitch=self.noise_pitch,
            texture_pitch=self.texture_pitch,
            subpixel=self.subpixel,
            step=self.step,
            texture_spread=self.texture_spread,
            weakest=self.weakest,
        )
