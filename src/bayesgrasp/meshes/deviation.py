"""How far convex parts are from the mesh that they stand for, in both directions; metres.

``excess`` is the distance by which the surface of the union of parts lies outside the mesh: what a finger touches
before it should, and what fills a bowl. ``gap`` is the distance by which the mesh lies outside the union: what a finger
passes through. Both are measured at points spread over the surfaces, so a maximum is a lower bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float, Float64
from scipy.spatial import cKDTree

from bayesgrasp.meshes.convex import ConvexPart
from bayesgrasp.meshes.mesh import Mesh, signed_volume

CANDIDATES = 12  # triangles with the nearest centres among which the nearest one is sought
MAX_EDGE = 0.005  # metres; longer edges are divided, so that near centres mean near triangles
MIN_POINTS = 50  # on each part
INSIDE = 1e-5  # metres; deeper in another part than this, a point is not on the surface of the union


@dataclass(frozen=True)
class Deviation:
    """Distances between parts and mesh, metres, and the volume of the parts over that of the mesh.

    Attributes:
        excess_99: 99th percentile over the surface of the union of the distance outside the mesh.
        excess_max: Largest of these distances.
        gap_max: Largest distance of a point of the mesh to the union (0 if all are inside).
        volume_ratio: Sum of the parts' volumes over the mesh's.
    """

    excess_99: float
    excess_max: float
    gap_max: float
    volume_ratio: float


def deviation(mesh: Mesh, parts: Sequence[ConvexPart], points: int = 4000) -> Deviation:
    """Compare parts with their mesh at about ``points`` points on each; the same points at every call."""
    surface = mesh.to_trimesh()
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, MAX_EDGE)
    fine = trimesh.Trimesh(vertices, faces, process=False)
    solids = [trimesh.Trimesh(part.vertices, part.faces, process=False) for part in parts]
    excess = np.maximum(outside_distance(fine, _union_points(parts, solids, points)), 0)
    on_mesh = np.asarray(trimesh.sample.sample_surface(surface, points, seed=0)[0], np.float64)
    gap = np.min([part.depth(on_mesh) for part in parts], axis=0)
    volume = sum(signed_volume(part.vertices[part.faces]) for part in parts)
    return Deviation(
        float(np.percentile(excess, 99)),
        float(excess.max()),
        max(float(gap.max()), 0.0),
        float(volume / mesh.volume),
    )


def outside_distance(surface: trimesh.Trimesh, points: Float[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
    """Distance of points to a surface, metres, positive on the side to which the nearest triangle faces.

    The triangles must be small, as the nearest one is sought among the `CANDIDATES` with the nearest centres.
    """
    triangles = np.asarray(surface.triangles)
    k = min(CANDIDATES, len(triangles))
    near = np.asarray(cKDTree(triangles.mean(axis=1)).query(points, k=np.arange(1, k + 1))[1])
    nearest = trimesh.triangles.closest_point(triangles[near.reshape(-1)], np.repeat(points, k, axis=0))
    offset = points[:, None] - nearest.reshape(-1, k, 3)
    distance = np.linalg.norm(offset, axis=2)
    best = distance.argmin(axis=1)
    rows = np.arange(len(points))
    facing = (offset[rows, best] * np.asarray(surface.face_normals)[near[rows, best]]).sum(axis=1)
    signed: Float64[np.ndarray, " n"] = np.where(facing >= 0, 1, -1) * distance[rows, best]
    return signed


def _union_points(
    parts: Sequence[ConvexPart], solids: Sequence[trimesh.Trimesh], points: int
) -> Float64[np.ndarray, "n 3"]:
    """Points on the surface of the union: on a part, and not inside another."""
    area = sum(solid.area for solid in solids)
    counts = [max(MIN_POINTS, int(points * solid.area / area)) for solid in solids]
    spread = [trimesh.sample.sample_surface(s, n, seed=1)[0] for s, n in zip(solids, counts, strict=True)]
    on_parts = np.concatenate(spread)
    owner = np.repeat(np.arange(len(parts)), [len(one) for one in spread])
    inside = np.zeros(len(on_parts), bool)
    for index, part in enumerate(parts):
        inside |= (owner != index) & (part.depth(on_parts) < -INSIDE)
    return np.asarray(on_parts[~inside], np.float64)
