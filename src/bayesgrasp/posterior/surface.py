"""What stands on the table, read from the canonical depth image without any network.

Every pixel with a return is a point of the world frame; points higher than a few times the sensor's noise above z = 0
are not the table. They answer the questions that a planner must ask before it trusts a posterior: is anything there,
is it inside the workspace, and is the table where the camera's pose says it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32
from scipy import ndimage

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera


@dataclass(frozen=True)
class SurfaceConfig:
    """What counts as an object.

    Attributes:
        table_thickness: Points lower than this are the table, metres.
        ceiling: Points higher than this are ignored (the arm, a lamp), metres.
        reach: Half side of the square around the workspace centre in which things are looked for, metres.
        workspace: Half side of the square that an object's middle must be in, metres.
        surroundings: Only the table is expected farther than this around the object, metres.
        min_pixels: Fewer pixels in one piece are noise.
        near, far: Range of the images, metres.
    """

    table_thickness: float = 0.012
    ceiling: float = 0.45
    reach: float = 0.35
    workspace: float = 0.12
    surroundings: float = 0.10
    min_pixels: int = 25
    near: float = 0.45
    far: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.table_thickness < self.ceiling or not 0 < self.workspace <= self.reach:
            raise InvalidConfigurationError("need 0 < table_thickness < ceiling and 0 < workspace <= reach, in metres")
        if self.min_pixels < 1 or self.surroundings <= 0 or not 0 < self.near < self.far:
            raise InvalidConfigurationError("need min_pixels >= 1, surroundings > 0 and 0 < near < far")


@dataclass(frozen=True)
class Surface:
    """The measured points of one image.

    Attributes:
        points: World points of all pixels, metres; NaN where there was no return.
        valid: Pixels with a return.
        item: Pixels of the object that stands nearest to the workspace centre; none where nothing is on the table.
        config: What counted as an object.
    """

    points: Float32[np.ndarray, "h w 3"]
    valid: Bool[np.ndarray, "h w"]
    item: Bool[np.ndarray, "h w"]
    config: SurfaceConfig

    @property
    def item_points(self) -> Float32[np.ndarray, "n 3"]:
        """World points of the object, metres."""
        return self.points[self.item]

    @property
    def center(self) -> Float[np.ndarray, "2"]:
        """Middle of the object's visible footprint (x, y), metres."""
        low, high = np.percentile(self.item_points[:, :2], (2, 98), axis=0)
        return (low + high) / 2

    def near(self, radius: float = 0.3) -> Float32[np.ndarray, "n 3"]:
        """Points on the table and above it within a square around the workspace centre, metres."""
        with np.errstate(invalid="ignore"):
            inside = self.valid & (np.abs(self.points[..., :2]) < radius).all(-1)
        return self.points[inside]

    def problem(self) -> str | None:
        """Why nothing can be planned, in words; None where something can."""
        if not self.valid.any():
            return "the camera does not see the workspace: no depth between 0.45 and 1 m in the canonical view"
        if not self.item.any():
            return (
                f"nothing on the table: nothing rises more than {1000 * self.config.table_thickness:.0f} mm above it "
                f"within {self.config.reach:.2f} m of the workspace centre"
            )
        x, y = self.center
        if max(abs(x), abs(y)) > self.config.workspace:
            return (
                f"outside the workspace: the nearest object is at ({x:.2f}, {y:.2f}) m, "
                f"at most {self.config.workspace:.2f} m from the centre in x and y can be planned"
            )
        return None


class SurfaceReader:
    """Turns images of one fixed camera into `Surface`s.

    Args:
        camera: The camera of the images, with its pose.
        config: What counts as an object.
    """

    def __init__(self, camera: Camera, config: SurfaceConfig | None = None) -> None:
        self.config = config or SurfaceConfig()
        self._rays = (camera.rays() @ camera.pose[:3, :3].T).astype(np.float32)
        self._origin = camera.pose[:3, 3].astype(np.float32)
        down = np.maximum(-self._rays[..., 2], 1e-6)
        table = self._origin[2] / down
        self._table_points = table[..., None] * self._rays + self._origin
        self._table = np.where((table >= self.config.near) & (table <= self.config.far), table, np.float32(0.0))

    def read(self, depth: Float32[np.ndarray, "h w"]) -> Surface:
        """The surface of a depth image (metres, 0 = no return)."""
        valid = depth > 0
        points = np.where(valid, depth, np.nan)[..., None] * self._rays + self._origin
        return Surface(points, valid, self._item(points), self.config)

    def cleared(self, depth: Float32[np.ndarray, "h w"], surface: Surface) -> Float32[np.ndarray, "h w"]:
        """The image with the bare table in place of whatever stands, or was not seen, away from the object.

        The sensor model knows one object on an empty table: another robot at the edge of a real image is not what the
        posterior is about. The object and its surroundings stay as they were measured. The same array is returned
        where nothing is to be cleared.
        """
        if not surface.item.any():
            return depth
        config, footprint = self.config, surface.item_points[:, :2]
        low, high = footprint.min(0) - config.surroundings, footprint.max(0) + config.surroundings
        place = np.where(surface.valid[..., None], surface.points, self._table_points)[..., :2]
        away = ((place < low) | (place > high)).any(-1)
        with np.errstate(invalid="ignore"):
            # Generous, so that a table seen by a camera that is slightly off its stated pose is left alone.
            table = np.abs(surface.points[..., 2]) < 3 * config.table_thickness
        strange = away & ~table & (depth != self._table)
        return np.where(strange, self._table, depth) if strange.any() else depth

    def _item(self, points: Float32[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"]:
        """The piece of the non-table pixels whose middle is nearest to the workspace centre."""
        config = self.config
        with np.errstate(invalid="ignore"):
            above = (points[..., 2] > config.table_thickness) & (points[..., 2] < config.ceiling)
            above &= (np.abs(points[..., :2]) < config.reach).all(-1)
        labels, count = ndimage.label(above)
        if count == 0:
            return above
        sizes = np.bincount(labels[above], minlength=count + 1)
        large = np.flatnonzero(sizes >= config.min_pixels)
        if len(large) == 0:
            return np.zeros_like(above)
        means = [ndimage.mean(points[..., axis], labels, large) for axis in (0, 1)]
        return labels == large[np.argmin(np.hypot(*means))]
