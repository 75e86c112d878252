"""Is a convex body certainly apart from convex regions? It is, if a face of each region has all of it on its far side.

A body with vertices v is beyond the face {p : n p = c} of a region if n v > c for all of them. With m the mean of the
vertices and r the distance of the farthest from it, that is so where n m - r > c, and cannot be where n m <= c; only
faces between the two need the vertices. The other way round nothing is said: an edge of each may be what separates two
bodies, so what is not apart here is only undecided.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import no_type_check

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numba import njit


@dataclass(frozen=True)
class Halfspaces:
    """A convex region {p : normals p <= offsets}, metres."""

    normals: Float64[np.ndarray, "faces 3"]
    offsets: Float64[np.ndarray, "faces"]


@dataclass(frozen=True)
class Regions:
    """Several convex regions, one after another.

    Attributes:
        faces: Of all of them.
        ends: Where the faces of each region end.
    """

    faces: Halfspaces
    ends: Int64[np.ndarray, "regions"]

    @staticmethod
    def of(regions: Sequence[Halfspaces]) -> Regions:
        """Pack regions."""
        faces = Halfspaces(np.concatenate([r.normals for r in regions]), np.concatenate([r.offsets for r in regions]))
        return Regions(faces, np.cumsum([len(r.offsets) for r in regions], dtype=np.int64))


@dataclass(frozen=True)
class Body:
    """A convex body.

    Attributes:
        vertices: In its own frame, metres.
    """

    vertices: Float64[np.ndarray, "vertices 3"]

    def certainly_apart(
        self, linear: Float64[np.ndarray, "n 3 3"], shift: Float64[np.ndarray, "n 3"], regions: Regions
    ) -> Bool[np.ndarray, "n"]:
        """Whether the body is certainly apart from all regions, in each of n places.

        Args:
            linear: Rotation times scale from the body's frame to that of the regions.
            shift: Then added, metres.
            regions: The regions.
        """
        faces = regions.faces
        apart: Bool[np.ndarray, "n"] = _separated(
            self.vertices, linear, shift, faces.normals, faces.offsets, regions.ends
        )
        return apart


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def _separated(vertices, linear, shift, normals, offsets, ends):
    """Whether (n,) there is a separating face for every region; arguments as above."""
    center, radius = np.zeros(3), 0.0
    for v in vertices:
        center += v / len(vertices)
    for v in vertices:
        radius = max(radius, np.sqrt(((v - center) ** 2).sum()))
    apart = np.ones(len(shift), dtype=np.bool_)
    for i in range(len(shift)):
        a, b = linear[i], shift[i]
        far = radius * np.sqrt(a[0, 0] ** 2 + a[1, 0] ** 2 + a[2, 0] ** 2)
        middle = a @ center + b
        moved = vertices @ a.T + b
        first = 0
        for end in ends:
            found = False
            for face in range(first, end):
                n, c = normals[face], offsets[face]
                if n[0] * middle[0] + n[1] * middle[1] + n[2] * middle[2] - far > c:
                    found = True
                    break
            face = first
            while not found and face < end:
                n, c = normals[face], offsets[face]
                face += 1
                if n[0] * middle[0] + n[1] * middle[1] + n[2] * middle[2] > c:
                    found = True
                    for v in moved:
                        if n[0] * v[0] + n[1] * v[1] + n[2] * v[2] <= c:
                            found = False
                            break
            first = end
            if not found:
                apart[i] = False
                break
    return apart
