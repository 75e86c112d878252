"""Triangle meshes: vertices in metres, faces wound so that they are seen counter-clockwise from outside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float64, Int32


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices: Metres, in the frame of the file.
        faces: Vertex indices, counter-clockwise seen from outside.
    """

    vertices: Float64[np.ndarray, "v 3"]
    faces: Int32[np.ndarray, "f 3"]

    @property
    def extents(self) -> Float64[np.ndarray, "3"]:
        """Lengths of the bounding box along the axes, metres."""
        size: Float64[np.ndarray, "3"] = np.ptp(self.vertices, axis=0)
        return size

    @property
    def volume(self) -> float:
        """Signed volume, m^3: negative if wound inwards; only a closed mesh has a meaningful one."""
        return signed_volume(self.vertices[self.faces])

    def to_trimesh(self) -> trimesh.Trimesh:
        """The same mesh as a trimesh object, untouched."""
        return trimesh.Trimesh(self.vertices, self.faces, process=False)


def signed_volume(triangles: Float64[np.ndarray, "f 3 3"]) -> float:
    """Volume enclosed by triangles, m^3, negative if they are wound inwards."""
    a, b, c = (triangles[:, k] - triangles[:, 0].mean(axis=0) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
