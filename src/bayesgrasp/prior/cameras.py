r"""The law of cameras: one that everybody knows, or any that a user may have.

The networks see what the canonical camera would see, so an image of another one is drawn again from there
(`observation.canonical_view`). That keeps 91 to 99 % of the points measured on an object, but what is left open differs
with the view: from above the sides are missing, from low down the top. A network must therefore have seen all of it:

    elevation ~ U(10 to 90 degrees),  distance ~ log U(0.4, 1.5 m),  field of view ~ U(55 to 80 degrees),
    make ~ structured light or stereo,  aim ~ U(a box about the middle of the workspace),  roll ~ N(0, 3 degrees).

Any azimuth is a turn of the world about z, which the planner undoes but for 0.35 rad; these are drawn. The fields of
view are those of a Kinect v1 (57 degrees), RealSense D415 and D435 (55 and 80 at 640x480), and Orbbec Astra (58).
A quarter of the images is of the canonical camera itself. What a user states of his camera is off by the errors of
`CameraPrior`, whichever camera it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial.transform import Rotation

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.prior.nuisance import CameraPrior
from bayesgrasp.prior.ranges import Interval, check_interval, uniform
from bayesgrasp.types import CameraNuisances, StatedCameras

CameraLaw = Literal["canonical", "any"]
"""Where images are taken from."""
CLEAR = 0.15
"""The middle of the workspace is at least this much beyond the near end of a sensor's range, metres."""


@dataclass(frozen=True)
class AnyCamera:
    """Cameras anywhere around the workspace.

    Attributes:
        errors: What a user's statement is off by, and the range of a structured-light sensor.
        elevation: Of the camera above the horizon, seen from where it aims, radians.
        azimuth: About the vertical, 0 for the canonical camera's side, radians.
        distance: From where it aims, metres; uniform in its logarithm.
        field_of_view: Across the 640 columns of the image, radians.
        aim: Half sides of the box of points that cameras aim at, metres; it stands on the table.
        roll: Standard deviation of the turn about the optical axis, radians.
        stereo_share: Share of stereo cameras; the others are structured light.
        stereo_near: Near end of a stereo camera's range, metres.
        canonical_share: Share of images of the canonical camera.

    Raises:
        InvalidConfigurationError: An interval is reversed, or a value outside its range.
    """

    errors: CameraPrior = field(default_factory=CameraPrior)
    elevation: Interval = (math.radians(10.0), math.radians(90.0))
    azimuth: Interval = (-0.35, 0.35)
    distance: Interval = (0.4, 1.5)
    field_of_view: Interval = (math.radians(55.0), math.radians(80.0))
    aim: tuple[float, float, float] = (0.05, 0.05, 0.05)
    roll: float = math.radians(3.0)
    stereo_share: float = 0.5
    stereo_near: float = 0.25
    canonical_share: float = 0.25

    def __post_init__(self) -> None:
        for name in ("elevation", "azimuth", "distance", "field_of_view"):
            check_interval(name, getattr(self, name))
        check_interval("distance", self.distance, minimum=0.1)
        if not (self.elevation[0] > 0 and self.elevation[1] <= math.pi / 2 + 1e-9):
            raise InvalidConfigurationError(f"elevation must lie in (0, pi / 2] radians, got {self.elevation}")
        if not (self.field_of_view[0] > 0 and self.field_of_view[1] < math.pi):
            raise InvalidConfigurationError(f"field_of_view must lie in (0, pi) radians, got {self.field_of_view}")
        if not (0 <= self.stereo_share <= 1 and 0 <= self.canonical_share <= 1):
            raise InvalidConfigurationError(
                f"shares must lie in [0, 1], got {self.stereo_share} and {self.canonical_share}"
            )
        if min(*self.aim, self.roll) < 0 or self.stereo_near <= 0:
            raise InvalidConfigurationError("aim and roll must be >= 0, and stereo_near positive, metres and radians")

    def sample(self, n: int, rng: np.random.Generator) -> StatedCameras:
        """Cameras of length n, as they are and as they are stated."""
        canonical, stereo = rng.random(n) < self.canonical_share, rng.random(n) < self.stereo_share
        stated = self._stated(canonical, stereo, rng)
        return _with_errors(stated, stereo, self.errors, rng)

    def _stated(
        self, canonical: Bool[np.ndarray, "n"], stereo: Bool[np.ndarray, "n"], rng: np.random.Generator
    ) -> CameraNuisances:
        """Where cameras are said to stand, relative to the canonical one, and their nominal range."""
        n, known = len(canonical), canonical_camera()
        near = np.where(stereo, self.stereo_near, self.errors.near)
        position, rotation = self._poses(near, rng)
        nominal = 2 * math.atan(known.width / 2 / known.fx)
        factor = np.where(canonical, 1.0, uniform(rng, self.field_of_view, n) / nominal)
        turn = Rotation.from_matrix(known.pose[:3, :3].T @ rotation).as_rotvec()
        stays = canonical[:, None]
        return CameraNuisances(
            position_offset=np.where(stays, 0.0, position - known.pose[:3, 3]).astype(np.float32),
            rotation_vector=np.where(stays, 0.0, turn).astype(np.float32),
            near=near.astype(np.float32),
            far=np.full(n, self.errors.far, np.float32),
            field_of_view_factor=factor.astype(np.float32),
        )

    def _poses(
        self, near: Float64[np.ndarray, "n"], rng: np.random.Generator
    ) -> tuple[Float64[np.ndarray, "n 3"], Float64[np.ndarray, "n 3 3"]]:
        """Positions, metres, and rotations camera_to_world."""
        n = len(near)
        elevation, azimuth = (rng.uniform(*interval, n) for interval in (self.elevation, self.azimuth))
        nearest = np.clip(near + CLEAR, *self.distance)
        distance = nearest * (self.distance[1] / nearest) ** rng.random(n)
        target = rng.uniform(-1.0, 1.0, (n, 3)) * np.array(self.aim)
        target[:, 2] += self.aim[2]
        side = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(n)], axis=1)
        up, flat = np.array([0.0, 0.0, 1.0]), np.cos(elevation)[:, None]
        away = flat * side + np.sin(elevation)[:, None] * up
        # Rows of the image run towards the camera's side of the table: from above, too, where `up` is no help.
        down = np.sin(elevation)[:, None] * side - flat * up
        upright = np.stack([np.cross(down, -away), down, -away], axis=2)
        turned = Rotation.from_rotvec(rng.normal(0.0, self.roll, n)[:, None] * up).as_matrix()
        return target + distance[:, None] * away, upright @ turned


def camera_law(name: CameraLaw) -> CameraPrior | AnyCamera:
    """The cameras of a data set, by name."""
    return CameraPrior() if name == "canonical" else AnyCamera()


def cameras_at(elevation: float, distance: float | None = None, azimuth: Interval = (-math.pi, math.pi)) -> AnyCamera:
    """Kinects at one elevation (radians) and distance (metres; the canonical camera's unless given), from all sides."""
    known = canonical_camera()
    distance = float(np.linalg.norm(known.pose[:3, 3] - [0.0, 0.0, 0.05])) if distance is None else distance
    view = 2 * math.atan(known.width / 2 / known.fx)
    return AnyCamera(
        elevation=(elevation, elevation),
        azimuth=azimuth,
        distance=(distance, distance),
        field_of_view=(view, view),
        aim=(0.0, 0.0, 0.05),
        roll=0.0,
        stereo_share=0.0,
        canonical_share=0.0,
    )


def _with_errors(
    stated: CameraNuisances, stereo: Bool[np.ndarray, "n"], errors: CameraPrior, rng: np.random.Generator
) -> StatedCameras:
    n, known = len(stated), canonical_camera()
    off = errors.sample(n, rng)
    relative = rng.uniform(-errors.relative_error, errors.relative_error, (n, 3))
    where = known.pose[:3, 3] + stated.position_offset
    turn = Rotation.from_rotvec(stated.rotation_vector) * Rotation.from_rotvec(off.rotation_vector)
    return StatedCameras(
        position_offset=(stated.position_offset + relative * where).astype(np.float32),
        rotation_vector=turn.as_rotvec().astype(np.float32),
        near=stated.near * off.near / np.float32(errors.near),
        far=off.far,
        field_of_view_factor=stated.field_of_view_factor * off.field_of_view_factor,
        stated_position_offset=stated.position_offset,
        stated_rotation_vector=stated.rotation_vector,
        stated_field_of_view_factor=stated.field_of_view_factor,
        stereo=stereo,
    )
