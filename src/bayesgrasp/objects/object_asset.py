"""One graspable object, in the object frame: what is drawn (mesh), what collides (convex parts), and how it is heavy.

Mass is a fact about the object and never derived from a mesh: scans are inflated, and bottles may be full. Its
distribution is unknown, so the parts have one density.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from bayesgrasp.errors import AssetError
from bayesgrasp.meshes.convex import ConvexPart

LEAST_MASS, MOST_MASS = 1e-4, 100.0
"""Kilograms: a paper clip has five times the one, and no hand lifts the other."""


@dataclass(frozen=True)
class ObjectAsset:
    """An object at rest on z = 0 with its centre of mass above the origin, at scale beta = 1; metres, kilograms.

    Attributes:
        id: Name in the catalogue.
        source: "household", "ycb", "procedural" or "file".
        split: "train", "unseen", "household", "procedural" or "other".
        mass_kg: Mass at scale 1.
        vertices: Mesh vertices.
        faces: Mesh triangles, counter-clockwise seen from outside.
        parts: Convex parts that cover the mesh.
        center_of_mass: At (0, 0, height).
        inertia: Inertia tensor about the centre of mass for a mass of 1 kg, m^2.
    """

    id: str
    source: str
    split: str
    mass_kg: float
    vertices: Float64[np.ndarray, "v 3"]
    faces: Int32[np.ndarray, "f 3"]
    parts: tuple[ConvexPart, ...]
    center_of_mass: Float64[np.ndarray, "3"]
    inertia: Float64[np.ndarray, "3 3"]

    def __post_init__(self) -> None:
        check_mass(self.mass_kg, self.id)
        if not self.parts:
            raise AssetError(f"object '{self.id}' has no convex part")

    @property
    def extents(self) -> Float64[np.ndarray, "3"]:
        """Lengths of the mesh's bounding box along the axes of the object frame, metres."""
        size: Float64[np.ndarray, "3"] = np.ptp(self.vertices, axis=0)
        return size


def check_mass(mass_kg: float, name: str) -> None:
    """Refuse a mass that no object for a hand has, nor any that physics could tell from nothing or from a wall.

    Raises:
        AssetError: It is not a number from `LEAST_MASS` to `MOST_MASS`.
    """
    if not LEAST_MASS <= mass_kg <= MOST_MASS:
        raise AssetError(f"object '{name}': mass is {mass_kg} kg; it must be from {LEAST_MASS} to {MOST_MASS:g} kg")
