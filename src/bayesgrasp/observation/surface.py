"""What stands on the table, read from the canonical depth image without any network.

Every pixel with a return is a point of the world frame; points higher than a few times the sensor's noise above the
table are not the table. The table is z = 0, but a camera whose stated pose is off by a hundredth of a radian sees it
tilted, a centimetre higher at one end; so heights are counted from the plane that the low points lie in. They answer
the questions that a planner must ask before it trusts a posterior: is anything there, is it inside the workspace, and
is the table where the camera's pose says it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int
from scipy import ndimage

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera

LOW = 3
"""The table is looked for among points closer to z = 0 than this many times `SurfaceConfig.table_thickness`."""
STRIDE = 4
"""Every so many pixels, each way, are looked at for the plane of the table."""
FEWEST = 50
"""With fewer of them the table is taken to be z = 0."""
UNSEEN = 0.001
"""What a camera did not see is filled in as a bare table at z = 0, which may rise above the table seen; metres."""
MAD_OF_NORMAL = 1.4826
"""Standard deviation of a normal law by its median absolute deviation."""


@dataclass(frozen=True)
class SurfaceConfig:
    """What counts as an object.

    Attributes:
        table_thickness: Points lower than this are the table, metres, at most.
        least_thickness: And at least; in between, a few times the noise of the table's own points (`spreads`).
        spreads: How many of its standard deviations the table's points may be above it.
        ceiling: Points higher than this are ignored (the arm, a lamp), metres.
        reach: Half side of the square around the workspace centre in which things are looked for, metres.
        workspace: Half side of the square that an object's middle must be in, metres.
        surroundings: Only the table is expected farther than this around the object, metres.
        min_pixels: Fewer pixels in one piece are noise.
        near, far: Range of the images, metres.
    """

    table_thickness: float = 0.012
    least_thickness: float = 0.006
    spreads: float = 5.0
    ceiling: float = 0.45
    reach: float = 0.35
    workspace: float = 0.12
    surroundings: float = 0.10
    min_pixels: int = 25
    near: float = 0.45
    far: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.least_thickness <= self.table_thickness < self.ceiling or not 0 < self.workspace <= self.reach:
            raise InvalidConfigurationError(
                "need 0 < least_thickness <= table_thickness < ceiling and 0 < workspace <= reach, in metres"
            )
        if self.min_pixels < 1 or min(self.surroundings, self.spreads) <= 0 or not 0 < self.near < self.far:
            raise InvalidConfigurationError("need min_pixels >= 1, surroundings > 0, spreads > 0 and 0 < near < far")


@dataclass(frozen=True)
class Surface:
    """The measured points of one image.

    Attributes:
        points: World points of all pixels, metres; NaN where there was no return.
        valid: Pixels with a return.
        item: Pixels of the object that stands nearest to the workspace centre; none where nothing is on the table.
        others: Number of the piece for each pixel of other things that rise above the table, elsewhere 0.
        table: (a, b, c) of the plane z = a + b x + c y that the table was seen in; zeros for an exact camera pose.
        thickness: Points less than this above the table, metres, counted as the table's.
        config: What counted as an object.
    """

    points: Float32[np.ndarray, "h w 3"]
    valid: Bool[np.ndarray, "h w"]
    item: Bool[np.ndarray, "h w"]
    others: Int[np.ndarray, "h w"]
    table: Float64[np.ndarray, "3"]
    thickness: float
    config: SurfaceConfig

    @property
    def item_points(self) -> Float32[np.ndarray, "n 3"]:
        """World points of the object, metres."""
        points: Float32[np.ndarray, "n 3"] = self.points[self.item]
        return points

    @property
    def center(self) -> Float[np.ndarray, "2"]:
        """Middle of the object's visible footprint (x, y), metres."""
        low, high = np.percentile(self.item_points[:, :2], (2, 98), axis=0)
        centre: Float[np.ndarray, "2"] = (low + high) / 2
        return centre

    def near(self, radius: float = 0.3) -> Float32[np.ndarray, "n 3"]:
        """Points on the table and above it within a square around the workspace centre, metres."""
        points: Float32[np.ndarray, "n 3"] = self.points[self.valid & in_square(self.points, radius)]
        return points

    def raised_points(self, radius: float = 0.3) -> Float64[np.ndarray, "n 3"]:
        """What stands on the table within a square around the workspace centre, with z counted from the table seen."""
        points = self.near(radius).astype(np.float64)
        points[:, 2] = heights(points, self.table)
        return points[points[:, 2] > self.thickness]

    def problem(self) -> str | None:
        """Why nothing can be planned, in words; None where something can."""
        if not self.valid.any():
            return "the camera does not see the workspace: no depth between 0.45 and 1 m in the canonical view"
        if not self.item.any():
            return (
                f"nothing on the table: nothing rises more than {1000 * self.thickness:.0f} mm above it "
                f"within {self.config.reach:.2f} m of the workspace centre"
            )
        x, y = self.center
        if max(abs(x), abs(y)) > self.config.workspace:
            return (
                f"outside the workspace: the nearest object is at ({x:.2f}, {y:.2f}) m, "
                f"at most {self.config.workspace:.2f} m from the centre in x and y can be planned"
            )
        return None


def in_square(points: Float[np.ndarray, "*batch 3"], half_side: float) -> Bool[np.ndarray, "*batch"]:
    """Which points are above or below a square of the table around the workspace centre; NaN is not."""
    with np.errstate(invalid="ignore"):
        inside: np.ndarray = (np.abs(points[..., 0]) < half_side) & (np.abs(points[..., 1]) < half_side)
    return inside


def heights(points: Float[np.ndarray, "*batch 3"], table: Float64[np.ndarray, "3"]) -> Float[np.ndarray, "*batch"]:
    """Heights of points above the plane z = a + b x + c y, metres, in the type of the points."""
    a, b, c = table.astype(points.dtype)
    above: np.ndarray = points[..., 2] - (a + b * points[..., 0] + c * points[..., 1])
    return above


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

    def read(self, depth: Float32[np.ndarray, "h w"], item: Bool[np.ndarray, "h w"] | None = None) -> Surface:
        """The surface of a depth image (metres, 0 = no return); the object is found unless given."""
        valid = depth > 0
        points = np.where(valid, depth, np.float32(np.nan))[..., None] * self._rays + self._origin
        table = self._fit_table(points[::STRIDE, ::STRIDE].reshape(-1, 3))
        thickness = self._thickness(points, table)
        pieces = self._pieces(points, table, thickness)
        item = self._item(points, pieces) if item is None else item
        return Surface(points, valid, item, np.where(item, 0, pieces), table, thickness, self.config)

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
        places = (np.where(surface.valid, surface.points[..., k], self._table_points[..., k]) for k in (0, 1))
        x_away, y_away = ((place < low[k]) | (place > high[k]) for k, place in enumerate(places))
        away = x_away | y_away
        with np.errstate(invalid="ignore"):
            # Generous, so that a table seen by a camera that is slightly off its stated pose is left alone.
            table = np.abs(surface.points[..., 2]) < LOW * config.table_thickness
        strange = away & ~table & (depth != self._table)
        return np.where(strange, self._table, depth) if strange.any() else depth

    def _fit_table(self, points: Float32[np.ndarray, "n 3"]) -> Float64[np.ndarray, "3"]:
        """The plane of the low points: their median height, then least squares, leaving out what is not near it."""
        config, plane = self.config, np.zeros(3)
        with np.errstate(invalid="ignore"):
            low = points[in_square(points, config.reach) & (np.abs(points[:, 2]) < LOW * config.table_thickness)]
        if len(low) < FEWEST:
            return plane
        low = low.astype(np.float64)
        plane[0] = np.median(low[:, 2])
        for _ in range(3):
            member = low[np.abs(heights(low, plane)) < config.table_thickness]
            if len(member) < FEWEST:
                return np.zeros(3)
            terms = np.column_stack([np.ones(len(member)), member[:, :2]])
            plane = np.linalg.lstsq(terms, member[:, 2], rcond=None)[0]
        return plane

    def _thickness(self, points: Float32[np.ndarray, "h w 3"], table: Float64[np.ndarray, "3"]) -> float:
        """Heights that the sensor's noise gives the table: a pen is thinner than what a noisy camera must leave out."""
        config, some = self.config, points[::STRIDE, ::STRIDE].reshape(-1, 3)
        above = heights(some[in_square(some, config.reach)], table)
        with np.errstate(invalid="ignore"):
            above = above[np.abs(above) < config.table_thickness]
        if len(above) < FEWEST:
            return config.table_thickness
        spread = MAD_OF_NORMAL * float(np.median(np.abs(above - np.median(above))))
        return min(max(config.spreads * spread, config.least_thickness), config.table_thickness)

    def _pieces(
        self, points: Float32[np.ndarray, "h w 3"], table: Float64[np.ndarray, "3"], thickness: float
    ) -> Int[np.ndarray, "h w"]:
        """The pieces of the non-table pixels that are large enough, numbered from 1; elsewhere 0."""
        config, height = self.config, heights(points, table)
        with np.errstate(invalid="ignore"):
            above = (height > thickness) & (height < config.ceiling) & (np.abs(points[..., 2]) > UNSEEN)
        above &= in_square(points, config.reach)
        pieces = _large_pieces(above, above, config.min_pixels)
        if pieces.any():
            return pieces
        # From above, the rim of a tumbler is a ring of fragments, each too small to be more than noise.
        return _large_pieces(above, ndimage.binary_dilation(above, np.ones((3, 3), bool)), config.min_pixels)

    def _item(self, points: Float32[np.ndarray, "h w 3"], pieces: Int[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
        """The piece whose middle is nearest to the workspace centre."""
        members = pieces[pieces > 0]
        if len(members) == 0:
            return np.zeros(pieces.shape, dtype=bool)
        sizes = np.bincount(members)
        numbers = np.flatnonzero(sizes)
        x, y = (np.bincount(members, points[..., axis][pieces > 0])[numbers] / sizes[numbers] for axis in (0, 1))
        chosen: Bool[np.ndarray, "h w"] = pieces == numbers[np.argmin(np.hypot(x, y))]
        return chosen


def _large_pieces(
    above: Bool[np.ndarray, "h w"], joined: Bool[np.ndarray, "h w"], least: int
) -> Int[np.ndarray, "h w"]:
    """Pixels numbered by the pieces of another mask that they are in, where these hold enough of them; else 0."""
    labels, count = ndimage.label(joined)
    large = np.bincount(labels[above], minlength=count + 1) >= least
    return np.where(large[labels] & above, labels, 0)
