"""Convex parts: what the physics engine collides with.

A mesh is cut into nearly convex pieces by CoACD (Wei et al. 2022), which measures concavity as a collision-aware
Hausdorff distance, here in metres; the paper used V-HACD (Mamou & Ghorbel 2009), kept as `PAPER`. Each piece is then
replaced by the hull of few of its vertices: starting from the extremes of a few directions, the vertex farthest
outside the hull so far joins it, until none is outside by more than ``tolerance_m`` or ``max_vertices`` are used.
What is then still outside is shared equally between both sides of the surface by pushing the hull outwards.
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Float64, Int32
from scipy.spatial import ConvexHull, QhullError

from bayesgrasp.errors import AssetError, InvalidConfigurationError
from bayesgrasp.meshes.mesh import signed_volume

log = logging.getLogger(__name__)

ALGORITHM_VERSION = 3  # of what the cache keeps: convex parts and resting pose
FLAT = 1e-6  # metres; first corners no farther than this from a plane need another one to span a volume
MIN_PART_VOLUME = 1e-9  # m^3: a cubic millimetre; smaller slivers carry no contact and upset hull algorithms


@dataclass(frozen=True)
class ConvexPart:
    """A convex polyhedron, wound outwards.

    Attributes:
        vertices: Corners, metres; every one is a corner of the hull.
        faces: Triangles of the hull, counter-clockwise seen from outside.
    """

    vertices: Float64[np.ndarray, "v 3"]
    faces: Int32[np.ndarray, "f 3"]

    def halfspaces(self) -> tuple[Float64[np.ndarray, "f 3"], Float64[np.ndarray, " f"]]:
        """Outward unit normals n and offsets b of the faces: a point p is inside where n . p <= b for all faces."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return normals, np.einsum("ij,ij->i", normals, a)

    def depth(self, points: Float[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
        """Signed distance bound of points, metres: negative inside, and at most the distance outside."""
        normals, offsets = self.halfspaces()
        outside: Float64[np.ndarray, " n"] = (points @ normals.T - offsets).max(axis=1)
        return outside


@dataclass(frozen=True)
class ConvexConfig:
    """How meshes are cut into convex parts.

    Attributes:
        algorithm: "coacd", or "vhacd" as in the paper.
        concavity_m: CoACD stops cutting where a piece is within this distance of its hull, metres.
        max_parts: No more parts than this; CoACD merges, V-HACD stops cutting.
        max_vertices: Corners of a part at most.
        tolerance_m: Distance below which a hull is not refined, metres.
        search_iterations: Iterations of CoACD's tree search for each cut.
        voxels: Voxel count of V-HACD.
    """

    algorithm: Literal["coacd", "vhacd"] = "coacd"
    concavity_m: float = 0.006
    max_parts: int = 32
    max_vertices: int = 64
    tolerance_m: float = 0.0005
    search_iterations: int = 60
    voxels: int = 100_000

    def __post_init__(self) -> None:
        if self.algorithm not in ("coacd", "vhacd"):
            raise InvalidConfigurationError(f"convex algorithm is {self.algorithm!r}; valid are 'coacd' and 'vhacd'")
        if self.max_vertices < 8 or self.max_parts < 1 or self.search_iterations < 1 or self.voxels < 1000:
            raise InvalidConfigurationError(
                f"max_vertices must be at least 8, max_parts and search_iterations at least 1, voxels 1000: {self}"
            )
        if not (self.concavity_m > 0 and self.tolerance_m >= 0):
            raise InvalidConfigurationError(f"concavity_m must be positive and tolerance_m not negative: {self}")


DEFAULT = ConvexConfig()
PAPER = ConvexConfig(algorithm="vhacd")
PRESETS = {"default": DEFAULT, "paper": PAPER}


def decompose(
    vertices: Float64[np.ndarray, "v 3"], faces: Int32[np.ndarray, "f 3"], config: ConvexConfig = DEFAULT
) -> tuple[ConvexPart, ...]:
    """Cut a closed mesh into convex parts that together cover it; seconds to a minute of processor time.

    Raises:
        AssetError: No part with a volume came out.
    """
    start = time.perf_counter()
    cut = _coacd if config.algorithm == "coacd" else _vhacd
    parts = [part for piece in cut(vertices, faces, config) if (part := _part_or_none(piece, config)) is not None]
    if not parts:
        raise AssetError(f"{config.algorithm} found no convex part with a volume in a mesh of {len(faces)} faces")
    log.info("%d convex parts by %s in %.1f s", len(parts), config.algorithm, time.perf_counter() - start)
    return tuple(parts)


def hull_part(points: Float64[np.ndarray, "n 3"], max_vertices: int = 10_000, tolerance: float = 0.0) -> ConvexPart:
    """The convex hull of points, thinned to ``max_vertices`` corners (see the module's docstring).

    Raises:
        AssetError: The points do not span a volume.
    """
    try:
        corners = points[ConvexHull(points).vertices]
        chosen, residual = _thin(corners, max_vertices, tolerance)
    except (QhullError, ValueError) as error:
        raise AssetError(f"{len(points)} points do not span a convex part with a volume") from error
    return _polyhedron(_grow(corners[chosen], residual / 2))


def _part_or_none(piece: Float64[np.ndarray, "n 3"], config: ConvexConfig) -> ConvexPart | None:
    try:
        part = hull_part(piece, config.max_vertices, config.tolerance_m)
    except AssetError:
        return None
    return part if signed_volume(part.vertices[part.faces]) > MIN_PART_VOLUME else None


def _thin(
    corners: Float64[np.ndarray, "n 3"], max_vertices: int, tolerance: float
) -> tuple[Bool[np.ndarray, " n"], float]:
    """Greedy choice of corners, and how far the farthest corner left out lies outside their hull, metres."""
    chosen = np.zeros(len(corners), bool)
    if len(corners) <= max(8, max_vertices) and tolerance == 0:
        chosen[:] = True
        return chosen, 0.0
    first = _FIRST_DIRECTIONS[: max(max_vertices // 2, 6)]
    chosen[(corners @ first.T).argmax(axis=0)] = True
    _, spread, axes = np.linalg.svd(corners[chosen] - corners[chosen].mean(axis=0))
    if spread[-1] < FLAT:
        height = corners @ axes[-1]
        chosen[[height.argmin(), height.argmax()]] = True
    while True:
        hull = ConvexHull(corners[chosen])
        outside = (corners @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        outside[chosen] = 0.0
        residual = float(outside.max())
        if residual <= max(tolerance, 1e-9) or chosen.sum() >= max_vertices:
            return chosen, residual
        chosen[outside.argmax()] = True


def _grow(points: Float64[np.ndarray, "n 3"], distance: float) -> Float64[np.ndarray, "n 3"]:
    """Move corners of a hull away from its centre by ``distance``, metres."""
    if distance < 1e-6:
        return points
    outwards = points - points.mean(axis=0)
    moved: Float64[np.ndarray, "n 3"] = points + distance * outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
    return moved


def _polyhedron(points: Float64[np.ndarray, "n 3"]) -> ConvexPart:
    hull = ConvexHull(points)
    index = np.full(len(points), -1)
    index[hull.vertices] = np.arange(len(hull.vertices))
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return ConvexPart(points[hull.vertices].astype(np.float64), index[faces].astype(np.int32))


def _coacd(
    vertices: Float64[np.ndarray, "v 3"], faces: Int32[np.ndarray, "f 3"], config: ConvexConfig
) -> list[Float64[np.ndarray, "n 3"]]:
    import coacd  # Only where nothing is cached.

    coacd.set_log_level("off")
    # No pre-processing: it would voxelise the mesh and make a 1 mm wall several millimetres thick.
    pieces = coacd.run_coacd(
        coacd.Mesh(vertices, faces),
        threshold=config.concavity_m,
        real_metric=True,
        max_convex_hull=config.max_parts,
        preprocess_mode="off",
        resolution=1000,
        mcts_nodes=10,
        mcts_iterations=config.search_iterations,
        seed=0,
    )
    return [np.asarray(points, np.float64) for points, _ in pieces]


def _vhacd(
    vertices: Float64[np.ndarray, "v 3"], faces: Int32[np.ndarray, "f 3"], config: ConvexConfig
) -> list[Float64[np.ndarray, "n 3"]]:
    import vhacdx  # Only where nothing is cached.

    counted = np.insert(faces, 0, 3, axis=1)  # each face is preceded by its number of corners
    pieces = vhacdx.compute_vhacd(
        vertices,
        counted.ravel().astype(np.uint32),
        maxConvexHulls=config.max_parts,
        resolution=config.voxels,
        maxNumVerticesPerCH=config.max_vertices,
        asyncACD=False,
    )
    return [np.asarray(points, np.float64) for points, _ in pieces]


# The axes first, then the diagonals of the sides and of the cube.
_FIRST_DIRECTIONS = np.array(
    sorted(
        ([x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)),
        key=lambda direction: np.count_nonzero(direction),
    ),
    np.float64,
)
