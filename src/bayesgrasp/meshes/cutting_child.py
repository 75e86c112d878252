"""Cut one mesh into pieces, in a process of its own: the program that `cutting` runs, never imported by the package.

    python cutting_child.py OPTIONS < mesh.npz > pieces.npz

OPTIONS is JSON: the fields of `ConvexConfig`, the most processor seconds and the most bytes of memory. It needs NumPy
and one of the two libraries, and nothing of the package, so that it starts in a tenth of a second.
"""

from __future__ import annotations

import ctypes
import io
import json
import os
import resource
import signal
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Pieces = list[np.ndarray]
DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux's prctl


def main(options: dict[str, Any]) -> None:
    """Read a mesh from standard input, write its pieces to standard output."""
    limit(options["seconds"], options["memory"])
    result = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the libraries print must not get between the pieces
    with np.load(io.BytesIO(sys.stdin.buffer.read())) as mesh:
        vertices, faces = mesh["vertices"], mesh["faces"]
    pieces = CUTTERS[options["algorithm"]](vertices, faces, options)
    with result:
        np.savez(result, vertices=np.concatenate(pieces), counts=np.array([len(piece) for piece in pieces]))


def limit(seconds: int, memory: int) -> None:
    """End this process where it needs more than that, and with its parent; it leaves no core file."""
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DIE_WITH_PARENT, signal.SIGKILL)


def by_coacd(vertices: np.ndarray, faces: np.ndarray, options: dict[str, Any]) -> Pieces:
    """CoACD's pieces."""
    import coacd  # one of the two is enough

    coacd.set_log_level("off")
    # No pre-processing: it would voxelise the mesh and make a 1 mm wall several millimetres thick.
    pieces = coacd.run_coacd(
        coacd.Mesh(vertices, faces),
        threshold=options["concavity_m"],
        real_metric=True,
        max_convex_hull=options["max_parts"],
        preprocess_mode="off",
        resolution=1000,
        mcts_nodes=10,
        mcts_iterations=options["search_iterations"],
        seed=0,
    )
    return _points(pieces)


def by_vhacd(vertices: np.ndarray, faces: np.ndarray, options: dict[str, Any]) -> Pieces:
    """V-HACD's pieces."""
    import vhacdx  # one of the two is enough

    counted = np.insert(faces, 0, 3, axis=1)  # each face is preceded by its number of corners
    pieces = vhacdx.compute_vhacd(
        vertices,
        counted.ravel().astype(np.uint32),
        maxConvexHulls=options["max_parts"],
        resolution=options["voxels"],
        maxNumVerticesPerCH=options["max_vertices"],
        asyncACD=False,
    )
    return _points(pieces)


def _points(pieces: Sequence[Sequence[Any]]) -> Pieces:
    """The vertices of pieces that come as pairs of vertices and faces."""
    found = [np.asarray(points, np.float64).reshape(-1, 3) for points, _ in pieces]
    return found or [np.empty((0, 3))]


CUTTERS: dict[str, Callable[[np.ndarray, np.ndarray, dict[str, Any]], Pieces]] = {"coacd": by_coacd, "vhacd": by_vhacd}

if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
