"""Objects made ready once: convex parts and resting pose, kept by the content of what they were made from.

The key is a hash of the mesh's vertices and faces, the configuration, and the versions of this code and of the
library that cut it. A file appears under its name only when complete (written aside, then renamed), and a lock beside
it lets one process build while the others wait for the result. A damaged file is built again.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import logging
import os
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from filelock import FileLock

from bayesgrasp.meshes.cache_directory import cache_directory
from bayesgrasp.meshes.convex import ALGORITHM_VERSION, DEFAULT, ConvexConfig, ConvexPart, decompose
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.meshes.resting import Resting, rest

log = logging.getLogger(__name__)

LIBRARIES = {"coacd": "coacd", "vhacd": "vhacdx"}


def prepare(mesh: Mesh, name: str, config: ConvexConfig = DEFAULT) -> Resting:
    """Convex parts and resting pose of a mesh, from the cache or built now.

    Args:
        mesh: A closed mesh.
        name: What to call it in the log.
        config: How to cut it.
    """
    return _cached(entry(mesh, config), lambda: _build(mesh, config), name)


def peek(mesh: Mesh, config: ConvexConfig = DEFAULT) -> Resting | None:
    """What the cache holds of a mesh, without building it."""
    return _read(entry(mesh, config))


def entry(mesh: Mesh, config: ConvexConfig = DEFAULT) -> Path:
    """The cache file of a mesh, existing or not."""
    library = LIBRARIES[config.algorithm]
    digest = hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes())
    digest.update(f"{config} {ALGORITHM_VERSION} {library} {importlib.metadata.version(library)}".encode())
    return cache_directory() / "objects" / f"{digest.hexdigest()[:32]}.npz"


def _build(mesh: Mesh, config: ConvexConfig) -> Resting:
    return rest(decompose(mesh.vertices, mesh.faces, config))


def _cached(path: Path, build: Callable[[], Resting], name: str) -> Resting:
    if (found := _read(path)) is not None:
        return found
    path.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(path.with_suffix(".lock")):
        if (found := _read(path)) is not None:
            return found
        log.warning("%s: cutting the mesh into convex parts, once (seconds to a minute)", name)
        built = build()
        _write(path, built)
    return built


def _read(path: Path) -> Resting | None:
    try:
        with path.open("rb") as file, np.load(file) as data:
            cuts, first = data["vertex_counts"].cumsum()[:-1], data["face_counts"].cumsum()[:-1]
            pieces = zip(np.split(data["vertices"], cuts), np.split(data["faces"], first), strict=True)
            return Resting(tuple(ConvexPart(v, f) for v, f in pieces), data["mesh_to_object"], float(data["floor"]))
    except FileNotFoundError:
        return None
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile):
        log.warning("%s is damaged and will be built again", path)
        return None


def _write(path: Path, resting: Resting) -> None:
    with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as aside:
        np.savez(
            aside,
            vertices=np.concatenate([part.vertices for part in resting.parts]),
            faces=np.concatenate([part.faces for part in resting.parts]),
            vertex_counts=np.array([len(part.vertices) for part in resting.parts]),
            face_counts=np.array([len(part.faces) for part in resting.parts]),
            mesh_to_object=resting.mesh_to_object,
            floor=resting.floor,
        )
    os.replace(aside.name, path)
