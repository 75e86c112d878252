"""Closed surfaces, wound outwards, of meshes that are not.

Scans are seldom solids. In this order: equal vertices are merged and faces without area dropped; edges with more than
two faces are taken apart by giving every fan of faces its own copy of the vertex; the winding is made consistent and
turned outwards; small holes, and the flat gap at the bottom that a scanner cannot see, are filled; a surface that is
still open (a bowl scanned from one side) becomes a shell of `SHELL_THICKNESS`.
"""

from __future__ import annotations

import logging

import numpy as np
import trimesh
from jaxtyping import Float64, Int, Int32
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from bayesgrasp.meshes.mesh import Mesh, signed_volume

log = logging.getLogger(__name__)

SHELL_THICKNESS = 0.0015  # metres
SMALL_HOLE = 0.25  # perimeter of a hole that is filled, as a share of the diagonal of the bounding box
DEBRIS = 1e-3  # share of the surface below which a separate body is dropped
BOTTOM_SHARE = 0.1  # height of the band, as a share of the object's height, in which the gap below an object lies


def close_surface(mesh: Mesh) -> Mesh:
    """Repair a mesh as the module's docstring says; a closed, outward mesh comes back with the same surface."""
    mesh = _wind(_without_debris(split_fans(_without_duplicates(mesh))))
    loops = boundary_loops(mesh.faces)
    if loops:
        mesh = _fill(mesh, [loop for loop in loops if _can_fill(mesh, loop)])
    if boundary_loops(mesh.faces):
        log.warning("the mesh is open: it becomes a shell %.1f mm thick", 1000 * SHELL_THICKNESS)
        mesh = _thicken(mesh)
    return mesh if mesh.volume >= 0 else Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())


def split_fans(mesh: Mesh) -> Mesh:
    """Give every fan of faces around a vertex its own copy of it, where fans meet only across non-manifold edges.

    Two corners at a vertex belong to one fan if their faces share an edge there that has exactly two faces.
    """
    n = len(mesh.faces)
    corner = np.arange(3 * n).reshape(n, 3)
    edges = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    at_start, at_end = corner.reshape(-1), np.roll(corner, -1, axis=1).reshape(-1)
    swap = edges[:, 0] > edges[:, 1]
    low, high = np.where(swap, at_end, at_start), np.where(swap, at_start, at_end)
    _, edge, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    shared = np.flatnonzero(count[edge] == 2)
    pairs = shared[np.argsort(edge[shared], kind="stable")].reshape(-1, 2)
    i = np.concatenate([low[pairs[:, 0]], high[pairs[:, 0]]])
    j = np.concatenate([low[pairs[:, 1]], high[pairs[:, 1]]])
    fans, label = connected_components(coo_matrix((np.ones(len(i)), (i, j)), shape=(3 * n, 3 * n)), directed=False)
    vertices = np.empty((fans, 3))
    vertices[label] = mesh.vertices[mesh.faces.reshape(-1)]
    return Mesh(vertices, label.reshape(n, 3).astype(np.int32))


def boundary_loops(faces: Int32[np.ndarray, "f 3"]) -> list[Int[np.ndarray, " n"]]:
    """Closed chains of vertices along edges that have one face, in the direction of that face's winding."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, inverse, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    follow = {int(a): int(b) for a, b in edges[count[inverse] == 1]}
    loops = []
    while follow:
        loop = [next(iter(follow))]
        while (after := follow.pop(loop[-1], None)) is not None and after != loop[0]:
            loop.append(after)
        loops.append(np.array(loop))
    return loops


def _without_duplicates(mesh: Mesh) -> Mesh:
    vertices, index = np.unique(np.round(mesh.vertices, 8), axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    faces = faces[distinct]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return Mesh(vertices, faces[np.sort(first)].astype(np.int32))


def _bodies(mesh: Mesh) -> list[Int[np.ndarray, " n"]]:
    """Indices of the faces of each connected body."""
    count = len(mesh.vertices)
    starts, ends = mesh.faces[:, [0, 1]].ravel(), mesh.faces[:, [1, 2]].ravel()
    _, label = connected_components(coo_matrix((np.ones(len(starts)), (starts, ends)), shape=(count, count)))
    of_face = label[mesh.faces[:, 0]]
    order = np.argsort(of_face, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(of_face[order])) + 1)


def _without_debris(mesh: Mesh) -> Mesh:
    """Drop bodies with a negligible share of the surface: flaps of two or three faces that scans shed."""
    area = np.linalg.norm(_normals(mesh), axis=1)
    bodies = [body for body in _bodies(mesh) if area[body].sum() > DEBRIS * area.sum()]
    used, faces = np.unique(mesh.faces[np.sort(np.concatenate(bodies))], return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3).astype(np.int32))


def _normals(mesh: Mesh) -> Float64[np.ndarray, "f 3"]:
    """Normals of the faces, as long as twice their area."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _wind(mesh: Mesh) -> Mesh:
    """Wind neighbouring faces alike, and every body outwards; a body inside another one stays a cavity."""
    solid = mesh.to_trimesh()
    if not solid.is_winding_consistent:
        trimesh.repair.fix_winding(solid)
    faces = np.array(solid.faces, np.int32)
    bodies = _bodies(mesh)
    corners = [mesh.vertices[faces[body]].reshape(-1, 3) for body in bodies]
    boxes = [(points.min(axis=0), points.max(axis=0)) for points in corners]
    for body, (low, high) in zip(bodies, boxes, strict=True):
        inside = any((low > other_low).all() and (high < other_high).all() for other_low, other_high in boxes)
        if not inside and signed_volume(mesh.vertices[faces[body]]) < 0:
            faces[body] = faces[body][:, ::-1]
    return Mesh(mesh.vertices, faces)


def _can_fill(mesh: Mesh, loop: Int[np.ndarray, " n"]) -> bool:
    points = mesh.vertices[loop]
    perimeter = np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1).sum()
    band = mesh.vertices[:, 2].min() + BOTTOM_SHARE * mesh.extents[2]
    return bool(perimeter < SMALL_HOLE * np.linalg.norm(mesh.extents) or points[:, 2].max() < band)


def _fill(mesh: Mesh, loops: list[Int[np.ndarray, " n"]]) -> Mesh:
    """Close each loop by a fan of triangles around its centre."""
    vertices, faces = [mesh.vertices], [mesh.faces]
    count = len(mesh.vertices)
    for loop in loops:
        centre = np.full(len(loop), count)
        vertices.append(mesh.vertices[loop].mean(axis=0, keepdims=True))
        faces.append(np.stack([np.roll(loop, -1), loop, centre], axis=1).astype(np.int32))
        count += 1
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


def _thicken(mesh: Mesh) -> Mesh:
    """Half the thickness to each side along the vertex normals, and a strip along every boundary edge."""
    normals = np.zeros_like(mesh.vertices)
    np.add.at(normals, mesh.faces.reshape(-1), np.repeat(_normals(mesh), 3, axis=0))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15)
    offset, n = SHELL_THICKNESS / 2 * normals, len(mesh.vertices)
    strips = []
    for loop in boundary_loops(mesh.faces):
        after = np.roll(loop, -1)
        strips += [np.stack([after, loop, loop + n], axis=1), np.stack([after, loop + n, after + n], axis=1)]
    faces = np.concatenate([mesh.faces, mesh.faces[:, ::-1] + n, *strips]).astype(np.int32)
    return Mesh(np.concatenate([mesh.vertices + offset, mesh.vertices - offset]), faces)
