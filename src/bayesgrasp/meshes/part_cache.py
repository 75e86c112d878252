"""Objects made ready once: convex parts and resting pose, kept by the content of what they were made from.

The key is a hash of the mesh's vertices and faces, the configuration, and the versions of this code and of the
library that cut it. A file appears under its name only when complete, and a lock beside it lets one process build while
the others wait for the result. A damaged file is built again.

What could not be cut as it was asked for is kept too, with the reason: it took long to find out, so the next time is as
quick as any other, and says the same.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import io
import logging
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from filelock import FileLock
from scipy.spatial import QhullError

from bayesgrasp.errors import AssetError, FileError, clipped
from bayesgrasp.files import make_directory, write_bytes
from bayesgrasp.meshes.cache_directory import CACHE_VARIABLE, cache_directory
from bayesgrasp.meshes.convex import ConvexPart
from bayesgrasp.meshes.decompose import DEFAULT, ConvexConfig, decompose
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.meshes.resting import Resting, rest

log = logging.getLogger(__name__)

ALGORITHM_VERSION = 3  # of what is kept
LIBRARIES = {"coacd": "coacd", "vhacd": "vhacdx"}


@dataclass(frozen=True)
class Kept:
    """What a file of the cache holds.

    Attributes:
        resting: Convex parts and pose; None where nothing could be made of the mesh.
        remark: Why it is not what was asked for; empty if it is.
    """

    resting: Resting | None
    remark: str


def cut_and_settle(mesh: Mesh, name: str, config: ConvexConfig = DEFAULT) -> Resting:
    """Convex parts and resting pose of a mesh, from the cache or made now.

    Args:
        mesh: A closed mesh.
        name: What to call it in the log and in errors: its file.
        config: How to cut it.

    Raises:
        AssetError: Nothing can be made of it.
        FileError: The cache cannot be written to.
    """
    path = cache_file(mesh, config)
    kept = _read(path) or _made_once(path, mesh, name, config)
    if kept.resting is None:
        raise AssetError(f"{name}: {kept.remark}")
    if kept.remark:
        log.warning("%s: %s (remove %s to try again)", name, kept.remark, path)
    return kept.resting


def peek(mesh: Mesh, config: ConvexConfig = DEFAULT) -> Resting | None:
    """What the cache holds of a mesh, without making it."""
    kept = _read(cache_file(mesh, config))
    return None if kept is None else kept.resting


def cache_file(mesh: Mesh, config: ConvexConfig = DEFAULT) -> Path:
    """The cache file of a mesh, existing or not."""
    library = LIBRARIES[config.algorithm]
    digest = hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes())
    digest.update(f"{config} {ALGORITHM_VERSION} {library} {importlib.metadata.version(library)}".encode())
    return cache_directory() / "objects" / f"{digest.hexdigest()[:32]}.npz"


def _made_once(path: Path, mesh: Mesh, name: str, config: ConvexConfig) -> Kept:
    """Made by this process, or by another one while this one waits."""
    with _locked(path):
        if (kept := _read(path)) is not None:
            return kept
        log.warning("%s: cutting the mesh into convex parts, once (seconds to a minute)", name)
        made = _make(mesh, config)
        _write(path, made)
    return made


def _make(mesh: Mesh, config: ConvexConfig) -> Kept:
    try:
        found = decompose(mesh.vertices, mesh.faces, config)
        return Kept(rest(found.parts), found.remark)
    except AssetError as error:
        return Kept(None, str(error))
    except QhullError as error:
        return Kept(None, f"it cannot be seen how the object rests: {clipped(error)}")


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    make_directory(path.parent)
    lock = FileLock(path.with_suffix(".lock"))
    try:
        lock.acquire()
    except OSError as error:
        reason = (error.strerror or clipped(error)).lower()
        raise FileError(f"cannot write to {path.parent}: {reason}; {CACHE_VARIABLE} names another place") from error
    try:
        yield
    finally:
        lock.release()


def _read(path: Path) -> Kept | None:
    try:
        with path.open("rb") as file, np.load(file) as data:
            cuts, first = data["vertex_counts"].cumsum()[:-1], data["face_counts"].cumsum()[:-1]
            remark = str(data["remark"]) if "remark" in data else ""
            if len(data["vertex_counts"]) == 0:
                return Kept(None, remark)
            pieces = zip(np.split(data["vertices"], cuts), np.split(data["faces"], first), strict=True)
            parts = tuple(ConvexPart(v, f) for v, f in pieces)
            return Kept(Resting(parts, data["mesh_to_object"], float(data["floor"])), remark)
    except FileNotFoundError:
        return None
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile):
        log.warning("%s is damaged and will be built again", path)
        return None


def _write(path: Path, kept: Kept) -> None:
    parts = () if kept.resting is None else kept.resting.parts
    content = io.BytesIO()
    np.savez(
        content,
        vertices=np.concatenate([part.vertices for part in parts]) if parts else np.empty((0, 3)),
        faces=np.concatenate([part.faces for part in parts]) if parts else np.empty((0, 3), np.int32),
        vertex_counts=np.array([len(part.vertices) for part in parts], np.int64),
        face_counts=np.array([len(part.faces) for part in parts], np.int64),
        mesh_to_object=np.eye(4) if kept.resting is None else kept.resting.mesh_to_object,
        floor=-np.inf if kept.resting is None else kept.resting.floor,
        remark=np.array(kept.remark),
    )
    write_bytes(path, content.getvalue())
