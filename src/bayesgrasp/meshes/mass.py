"""How convex parts of one density are heavy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from jaxtyping import Float64

from bayesgrasp.meshes.convex import ConvexPart


def mass_properties(
    parts: Sequence[ConvexPart],
) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]]:
    """Centre of mass and inertia per kilogram of convex parts of one density.

    Where parts overlap the overlap counts twice; CoACD's overlap only by what their hulls add.

    Returns:
        Centre of mass, metres; inertia tensor about it divided by the mass, m^2.
    """
    triangles = np.concatenate([part.vertices[part.faces] for part in parts])
    found = trimesh.triangles.mass_properties(triangles, density=1.0)
    inertia = np.array(found.inertia, np.float64) / found.mass
    return np.array(found.center_mass, np.float64), (inertia + inertia.T) / 2
