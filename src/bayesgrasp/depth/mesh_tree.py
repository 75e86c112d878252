"""One ray tree per mesh, in the frame of the object at scale 1.

A scene is never built: rays are moved into the object frame, p_object = Rz(-yaw) (p_world - (x, y, 0)) / beta, and ray
directions are scaled so that the ray parameter stays the depth in metres. A tree is therefore built once and serves
every pose and scale. The tree (Embree, single precision) only says which triangle a ray hits; the depth is then
computed from the plane of that triangle in double precision.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore import EmbreeDevice
from embreex.rtcore_scene import EmbreeScene
from jaxtyping import Float, Float32, Float64, Int, Int32
from scipy.spatial import ConvexHull

from bayesgrasp.errors import AssetError

HULL_DIRECTIONS = 500


class MeshTree:
    """Ray queries against one triangle mesh; its orientation does not matter.

    Attributes:
        planes: Unit normal n and offset c of every triangle, n . p = c, object frame.
        hull: Vertices of a convex polytope around the mesh, a little larger than the convex hull, object frame, metres.

    Raises:
        AssetError: The mesh has no triangle of positive area, or a vertex that is not finite.
    """

    planes: Float64[np.ndarray, "f 4"]
    hull: Float64[np.ndarray, "v 3"]

    def __init__(self, vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]) -> None:
        vertices = np.asarray(vertices, dtype=np.float64)
        if not np.isfinite(vertices).all():
            raise AssetError("a mesh to be seen has vertices that are not finite numbers")
        corners = vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        doubled_area = np.linalg.norm(normals, axis=1)
        solid = doubled_area > 0  # a sliver without area has no plane, and no ray hits it
        if not solid.any():
            raise AssetError("a mesh to be seen needs at least one triangle of positive area")
        corners, normals = corners[solid], normals[solid] / doubled_area[solid, None]
        offsets = np.einsum("ij,ij->i", normals, corners.mean(axis=1))
        self.planes = np.concatenate([normals, offsets[:, None]], axis=1)
        self.hull = _enclosing_polytope(vertices[np.unique(faces)])
        self._scene = EmbreeScene(device=_device(), robust=True)
        TriangleMesh(self._scene, np.ascontiguousarray(corners, dtype=np.float32))

    def first_hit(
        self, origins: Float32[np.ndarray, "n 3"], directions: Float32[np.ndarray, "n 3"]
    ) -> Int32[np.ndarray, "n"]:
        """Index of the first triangle along each ray (object frame), -1 for none."""
        return self._scene.run(origins, directions, query="INTERSECT") if len(origins) else np.empty(0, np.int32)

    def occluded(
        self, origins: Float32[np.ndarray, "n 3"], directions: Float32[np.ndarray, "n 3"]
    ) -> Int32[np.ndarray, "n"]:
        """At least 0 where a ray (object frame) meets the mesh anywhere, -1 where it does not."""
        return self._scene.run(origins, directions, query="OCCLUDED") if len(origins) else np.empty(0, np.int32)


@cache
def _device() -> EmbreeDevice:
    """One for all trees of a process: Embree crashes where a few thousand are open, as one for each tree would be."""
    return EmbreeDevice()


def _enclosing_polytope(points: Float64[np.ndarray, "v 3"]) -> Float64[np.ndarray, "h 3"]:
    """The hull of the extreme points along some directions, blown up about its middle until it holds all points.

    A scan's hull has thousands of vertices, and every image projects them all.
    """
    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-9) < 3:
        return points
    extreme = points[np.unique((points @ _directions(HULL_DIRECTIONS).T).argmax(axis=0))]
    hull = ConvexHull(extreme)
    normals, offsets = hull.equations[:, :3], -hull.equations[:, 3]
    middle = extreme.mean(axis=0)
    reach = ((points - middle) @ normals.T).max(axis=0) / (offsets - normals @ middle)
    corners: Float64[np.ndarray, "h 3"] = middle + (extreme[hull.vertices] - middle) * max(1.0, reach.max())
    return corners


def _directions(count: int) -> Float64[np.ndarray, "n 3"]:
    """Unit vectors spread evenly over the sphere (a golden-angle spiral)."""
    index = np.arange(count)
    z, turn = 1 - (2 * index + 1) / count, index * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
