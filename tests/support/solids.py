"""A closed surface, whether another one is as closed, and files of it."""

from pathlib import Path

import numpy as np
import trimesh

from bayesgrasp.meshes.mesh import Mesh


def cube() -> Mesh:
    """A box of 6 x 8 x 10 cm about the origin, of many faces."""
    made = trimesh.creation.box(extents=(0.06, 0.08, 0.1)).subdivide().subdivide().subdivide().subdivide()
    return Mesh(np.array(made.vertices, np.float64), np.array(made.faces, np.int32))


def is_solid(mesh: Mesh) -> bool:
    """Whether a surface is closed and wound outwards."""
    made = mesh.to_trimesh()
    return bool(made.is_watertight and made.is_winding_consistent and mesh.volume > 0)


def write(mesh: Mesh, path: Path) -> Path:
    """A file of a mesh, of the format that its name says."""
    mesh.to_trimesh().export(path)
    return path
