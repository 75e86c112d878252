"""Triangle meshes from files: bounded, read, judged, and made into closed surfaces (`repair`).

A file is read only if it is a regular one and not larger than any mesh of use can be; what its header promises, and
what is found in it, is bounded too. Whatever is wrong with it, the error is one short line.
"""

from __future__ import annotations

import io
import re
import struct
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float64, Int

from bayesgrasp.errors import AssetError, FileError, clipped
from bayesgrasp.files import MIB, read_bytes
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.meshes.repair import close_surface

FORMATS = (".ply", ".stl", ".obj", ".off")
MIN_EXTENT, MAX_EXTENT = 0.003, 2.0  # metres: an object outside this range is not in metres, or not for a hand
LARGEST_FILE = 128 * MIB  # the finest official scans have 60 MiB
MOST_ELEMENTS = 1_000_000  # vertices, and faces; the finest official scans have half as many
HEADER = 4096  # bytes in which a header's numbers are looked for
DECLARED = {  # how the headers of two formats say how many elements follow; the others' sizes say it
    ".ply": re.compile(rb"^\s*element\s+\S+\s+(\d+)", re.MULTILINE),
    ".off": re.compile(rb"\A\s*\w*OFF\s+(?:#[^\n]*\n\s*)*(\d+)\s+(\d+)"),
}
_PARSER_ERRORS = (  # Four unrelated parsers read the formats, and each fails in its own way on a damaged file.
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    NameError,
    NotImplementedError,
    OSError,
    RecursionError,
    TypeError,
    ValueError,
    struct.error,
)


def read_mesh(path: Path) -> Mesh:
    """Read a mesh file in metres, and make it a closed surface wound outwards.

    Raises:
        AssetError: The file is missing, not a regular one, of another format, too large, damaged, empty, not finite,
            flat, or not in metres.
    """
    name, suffix = short(path), path.suffix.lower()
    if not path.exists():
        raise AssetError(f"there is no mesh file {name}")
    if suffix not in FORMATS:
        raise AssetError(f"{name}: cannot read a '{clipped(suffix, 20)}' mesh; valid are {', '.join(FORMATS)}")
    try:
        content = read_bytes(path, LARGEST_FILE)
    except FileError as error:
        raise AssetError(str(error).replace(str(path), name)) from error
    _check_header(content, suffix, name)
    mesh = checked(*_parse(content, suffix, name), name)
    return close_surface(mesh)


def short(path: Path) -> str:
    """A path as a message names it: on one line, and of a very long one the end only."""
    text = str(path)
    return clipped(text if len(text) <= 100 else f"...{text[-97:]}", 100)


def checked(vertices: Float64[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"], name: str) -> Mesh:
    """A mesh of these faces, unless no repair could save it.

    Raises:
        AssetError: See `read_mesh`; ``name`` says where.
    """
    _check_number(max(len(vertices), len(faces)), name)
    if len(faces) == 0:
        raise AssetError(f"{name}: the mesh has no faces ({len(vertices)} vertices); a point cloud cannot be used")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise AssetError(f"{name}: faces name vertices outside 0..{len(vertices) - 1}")
    used, index = np.unique(faces, return_inverse=True)
    mesh = Mesh(vertices[used], index.reshape(-1, 3).astype(np.int32))
    bad = int((~np.isfinite(mesh.vertices)).any(axis=1).sum())
    if bad:
        raise AssetError(f"{name}: {bad} of {len(mesh.vertices)} vertices are not finite (NaN or infinite)")
    _check_extents(mesh, name)
    return mesh


def _check_extents(mesh: Mesh, name: str) -> None:
    with np.errstate(over="ignore"):
        size = mesh.extents
    text = " x ".join(f"{s:.4g}" for s in size)
    if size.max() > MAX_EXTENT or size.max() < MIN_EXTENT:
        hint = "; it seems to be in millimetres, scale it by 0.001" if 3 < size.max() < 2000 else ""
        raise AssetError(
            f"{name}: extents {text} m; the largest must lie between {MIN_EXTENT} and {MAX_EXTENT} m{hint}"
        )
    if size.min() < 1e-4:
        raise AssetError(f"{name}: the mesh is flat (extents {text} m); every extent must be at least 0.0001 m")


def _check_header(content: bytes, suffix: str, name: str) -> None:
    """Refuse what promises too much before a parser makes room for it."""
    if suffix in DECLARED:
        for found in DECLARED[suffix].finditer(content[:HEADER]):
            _check_number(max(int(digits[:20]) for digits in found.groups()), name)


def _parse(content: bytes, suffix: str, name: str) -> tuple[Float64[np.ndarray, "v 3"], Int[np.ndarray, "f 3"]]:
    """Vertices and faces as they stand in a file."""
    try:
        # From memory: a file that names others (materials, textures) gets none of them opened.
        loaded = trimesh.load_mesh(io.BytesIO(content), file_type=suffix[1:], process=False, skip_materials=True)
    except _PARSER_ERRORS as error:
        raise AssetError(f"{name}: not a readable {suffix} mesh ({clipped(error, 120)})") from error
    if not isinstance(loaded, trimesh.Trimesh):
        raise AssetError(f"{name}: holds no triangle mesh")
    vertices, faces = np.array(loaded.vertices, np.float64), np.array(loaded.faces, np.int64)
    if vertices.shape[1:] != (3,) or faces.shape[1:] not in ((3,), ()):
        raise AssetError(f"{name}: not a readable {suffix} mesh (its vertices or faces are not of three numbers)")
    return vertices, faces.reshape(-1, 3)


def _check_number(elements: int, name: str) -> None:
    if elements > MOST_ELEMENTS:
        raise AssetError(
            f"{name}: {elements:,} vertices or faces; at most {MOST_ELEMENTS:,} are read, so make the mesh coarser"
        )
