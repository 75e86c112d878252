"""Shaded pictures by ray casting: no display, no graphics driver, the same on every machine.

A picture is a list of coloured triangle meshes seen by a `Camera`, lit by one distant light and a fill light.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import embreex.mesh_construction
import embreex.rtcore_scene
import mujoco
import numpy as np
import trimesh
from jaxtyping import Float, Int, UInt8

from bayesgrasp.geometry.camera import Camera

Color = tuple[float, float, float]
_SKY = np.array([0.93, 0.95, 0.97])
_LIGHT = np.array([0.35, 0.45, 0.82])
_NO_HIT = -1


@dataclass(frozen=True)
class ColoredMesh:
    """Triangles in the world frame (metres) with one colour (red, green, blue in 0..1)."""

    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]
    color: Color


def render(meshes: Sequence[ColoredMesh], camera: Camera) -> UInt8[np.ndarray, "h w 3"]:
    """The picture of some meshes from a camera with a pose."""
    triangles = np.concatenate([m.vertices[m.faces] for m in meshes])
    colors = np.concatenate([np.tile(m.color, (len(m.faces), 1)) for m in meshes])
    normals = _unit(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]))
    pose = camera.pose
    directions = _unit(camera.rays().reshape(-1, 3) @ pose[:3, :3].T)
    hit = _first_hit(triangles, np.broadcast_to(pose[:3, 3], directions.shape), directions)
    picture = np.tile(_SKY, (len(directions), 1))
    seen = hit != _NO_HIT
    facing = normals[hit[seen]]
    # Meshes may be wound either way and open, so a surface is lit on whichever side is seen.
    facing = np.where((facing * directions[seen]).sum(axis=1, keepdims=True) > 0, -facing, facing)
    sun = np.clip(facing @ _unit(_LIGHT), 0.0, 1.0)
    # The fill light shines from the camera: what neither reaches keeps a quarter of its colour.
    fill = np.clip(-(facing * directions[seen]).sum(axis=1), 0.0, 1.0)
    picture[seen] = colors[hit[seen]] * (0.25 + 0.5 * sun + 0.25 * fill)[:, None]
    image: UInt8[np.ndarray, "h w 3"] = (255 * picture.clip(0, 1)).astype(np.uint8)
    return image.reshape(camera.height, camera.width, 3)


def contact_sheet(pictures: Sequence[UInt8[np.ndarray, "h w 3"]], columns: int) -> UInt8[np.ndarray, "height width 3"]:
    """Pictures of one size side by side, row by row, on white."""
    rows = -(-len(pictures) // columns)
    height, width = pictures[0].shape[:2]
    sheet = np.full((rows * (height + 4), columns * (width + 4), 3), 255, dtype=np.uint8)
    for index, picture in enumerate(pictures):
        row, column = divmod(index, columns)
        top, left = row * (height + 4), column * (width + 4)
        sheet[top : top + height, left : left + width] = picture
    return sheet


def physics_meshes(model: mujoco.MjModel, data: mujoco.MjData) -> list[ColoredMesh]:
    """The shapes of a physics state; the infinite table is drawn as a square of 1.2 m."""
    meshes = []
    for geom in range(model.ngeom):
        vertices, faces = _geom_triangles(model, geom)
        rotation = data.geom_xmat[geom].reshape(3, 3)
        red, green, blue = (float(c) for c in model.geom_rgba[geom, :3])
        meshes.append(ColoredMesh(vertices @ rotation.T + data.geom_xpos[geom], faces, (red, green, blue)))
    return meshes


def _geom_triangles(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, np.ndarray]:
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        vertices = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
        faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        return model.mesh_vert[vertices].astype(np.float64), model.mesh_face[faces]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        solid = trimesh.creation.box(extents=2 * size)
    elif kind == mujoco.mjtGeom.mjGEOM_PLANE:
        solid = trimesh.creation.box(extents=(1.2, 1.2, 1e-4))
    else:
        solid = trimesh.creation.capsule(height=2 * size[1], radius=size[0], count=(16, 16))
        # MuJoCo's capsule has its middle at the origin; trimesh's has in some releases only.
        solid.vertices[:, 2] -= 0.5 * (solid.vertices[:, 2].max() + solid.vertices[:, 2].min())
    return np.asarray(solid.vertices), np.asarray(solid.faces)


def _first_hit(triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> Int[np.ndarray, "rays"]:
    scene = embreex.rtcore_scene.EmbreeScene()
    embreex.mesh_construction.TriangleMesh(scene, triangles.astype(np.float32))
    hits: Int[np.ndarray, "rays"] = scene.run(origins.astype(np.float32), directions.astype(np.float32))
    return hits


def _unit(vectors: np.ndarray) -> np.ndarray:
    units: np.ndarray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return units
