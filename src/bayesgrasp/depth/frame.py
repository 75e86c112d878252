"""What one image is measured from, as plain tuples: these are what the compiled loops take.

A `Frame` is one camera that looks at one object; an `ObjectRegion` is the part of its image where there may be more
than bare table; `Pixels` are those that somebody wants; `Matches` are what a device makes of them on the way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64, Int32, Int64

TABLE = -1
"""Plane index of the table."""
BARE_TABLE = -1.0
"""Disparity of a match that leaves the pixel as the device senses the bare table there."""
Lattices = tuple[Float32[np.ndarray, "..."], ...]


class View(NamedTuple):
    """One camera looking at one object, in the object frame (scale 1); M and o are those of `ray_kernels`.

    Attributes:
        ray_matrix: M, from homogeneous pixels to rays per metre of depth.
        origin: o, the camera.
        second_eye: Position of a Kinect's projector, or of a stereo pair's other camera.
    """

    ray_matrix: Float64[np.ndarray, "3 3"]
    origin: Float64[np.ndarray, "3"]
    second_eye: Float64[np.ndarray, "3"]


class Limits(NamedTuple):
    """What an image can hold: depths outside near..far (metres) are not returned; `width` of the whole image, px."""

    near: float
    far: float
    width: int


class Frame(NamedTuple):
    """What is measured in one image.

    Attributes:
        camera: Which looks (compiled loops know no field named `view`).
        limits: Of depth and width.
        noise: Random lattices over the whole image, of the device's making.
    """

    camera: View
    limits: Limits
    noise: Lattices


class Region(NamedTuple):
    """A rectangle of the image, and which plane is seen at each of its pixels.

    Attributes:
        row, column: The first pixel.
        plane: Index of a triangle, or `TABLE`.
        inverse_depth: 1 / m; at most 0 where nothing is seen.
    """

    row: int
    column: int
    plane: Int32[np.ndarray, "h w"]
    inverse_depth: Float64[np.ndarray, "h w"]


class ObjectRegion(NamedTuple):
    """The neighbourhood of the object in an image.

    Attributes:
        planes: Of the mesh, see `MeshTree`.
        region: What is seen there.
        near: Columns of each row of the image where there may be more than bare table: first, and one past the last.
        hidden: Columns of each row of the image where the second eye may not see the table.
        noise: Random lattices over the region, of the device's making.
    """

    planes: Float64[np.ndarray, "f 4"]
    region: Region
    near: Int64[np.ndarray, "rows 2"]
    hidden: Int64[np.ndarray, "rows 2"]
    noise: Float32[np.ndarray, "layers a b"]


class Pixels(NamedTuple):
    """Rows and columns that are evaluated, and the image (metres) that they are written to."""

    rows: Int64[np.ndarray, "r"]
    columns: Int64[np.ndarray, "c"]
    image: Float32[np.ndarray, "r c"]


class Matches(NamedTuple):
    """What the pixels were matched to; one entry per evaluated pixel, row by row.

    Attributes:
        disparity: In the device's unit, 0 for none, `BARE_TABLE` for nothing but table.
        cosine: Of the tilt: between the surface's normal and the ray.
        ray: Index of its ray to the second eye, -1 if it needs none.
        origins, directions: Rays to the second eye, object frame; those that meet the object have no match.
    """

    disparity: Float64[np.ndarray, "n"]
    cosine: Float64[np.ndarray, "n"]
    ray: Int64[np.ndarray, "n"]
    origins: Float32[np.ndarray, "rays 3"]
    directions: Float32[np.ndarray, "rays 3"]
