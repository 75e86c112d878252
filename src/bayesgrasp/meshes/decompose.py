"""The cutting of a mesh into nearly convex pieces, and what becomes of a mesh that cannot be cut.

CoACD (Wei et al. 2022) measures concavity as a collision-aware Hausdorff distance, here in metres; the paper used
V-HACD (Mamou & Ghorbel 2009), kept as `PAPER`. Each piece is then replaced by the hull of few of its vertices
(`convex`).

There are meshes on which CoACD crashes, and small ones on which it does not end. So cutting happens in a process of its
own, with limits (`cutting`); where it fails V-HACD cuts instead, and where that fails too the convex hull of the whole
mesh is the only part. Which it was is said in `Decomposition.remark`.
"""

from __future__ import annotations

import logging
import time
from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int32

from bayesgrasp.errors import AssetError, InvalidConfigurationError
from bayesgrasp.meshes.convex import ConvexPart, hull_part
from bayesgrasp.meshes.cutting import LIMITS, CutLimits, CuttingFailedError, cut_apart
from bayesgrasp.meshes.mesh import signed_volume

log = logging.getLogger(__name__)

MIN_PART_VOLUME = 1e-9  # m^3: a cubic millimetre; smaller slivers carry no contact and upset hull algorithms
Algorithm = Literal["coacd", "vhacd"]
NAMES: dict[Algorithm, str] = {"coacd": "CoACD", "vhacd": "V-HACD"}
IN_TURN: dict[Algorithm, tuple[Algorithm, ...]] = {"coacd": ("coacd", "vhacd"), "vhacd": ("vhacd",)}


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

    algorithm: Algorithm = "coacd"
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


@dataclass(frozen=True)
class Decomposition:
    """What came of a mesh.

    Attributes:
        parts: They cover it together.
        remark: Why they are not what was asked for; empty if they are.
    """

    parts: tuple[ConvexPart, ...]
    remark: str = ""


def decompose(
    vertices: Float64[np.ndarray, "v 3"],
    faces: Int32[np.ndarray, "f 3"],
    config: ConvexConfig = DEFAULT,
    limits: CutLimits = LIMITS,
) -> Decomposition:
    """Cut a closed mesh into convex parts that together cover it; seconds to a minute of processor time.

    Args:
        vertices: Metres.
        faces: Wound outwards.
        config: How to cut.
        limits: What each of the algorithms may cost.

    Raises:
        AssetError: Nothing can be made of it, not even a hull.
    """
    failures = []
    for algorithm in IN_TURN[config.algorithm]:
        start = time.perf_counter()
        try:
            pieces = cut_apart(vertices, faces, asdict(config) | {"algorithm": algorithm}, limits)
            parts = _parts(pieces, config)
        except CuttingFailedError as error:
            failures.append(f"{NAMES[algorithm]} {error}")
            continue
        log.info("%d convex parts by %s in %.1f s", len(parts), NAMES[algorithm], time.perf_counter() - start)
        return Decomposition(parts, f"{failures[0]}, so {NAMES[algorithm]} cut the mesh" if failures else "")
    said = " and ".join(failures)
    hull = _part_or_none(vertices, config)
    if hull is None:
        raise AssetError(f"the mesh cannot be cut into convex parts: {said}, and its convex hull has no volume")
    return Decomposition((hull,), f"{said}, so the convex hull is its only part")


def _parts(pieces: list[Float64[np.ndarray, "_ 3"]], config: ConvexConfig) -> tuple[ConvexPart, ...]:
    """Hulls of the pieces that have a volume.

    Raises:
        CuttingFailedError: None has.
    """
    parts = tuple(part for piece in pieces if (part := _part_or_none(piece, config)) is not None)
    if not parts:
        raise CuttingFailedError("gave no part with a volume")
    return parts


def _part_or_none(piece: Float64[np.ndarray, "n 3"], config: ConvexConfig) -> ConvexPart | None:
    try:
        part = hull_part(piece, config.max_vertices, config.tolerance_m)
    except AssetError:
        return None
    return part if signed_volume(part.vertices[part.faces]) > MIN_PART_VOLUME else None
