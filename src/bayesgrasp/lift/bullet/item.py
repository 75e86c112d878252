"""The object and the table in PyBullet, translated from the compiled MuJoCo model.

The object becomes a free body with one convex hull for each of its parts. PyBullet puts a skin of `MARGIN` around a
hull, inside which it finds contacts without penetration. Parts are eroded by it first, so that hull and skin together
are the part again.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from bayesgrasp.errors import AssetError
from bayesgrasp.lift.bullet.client import Client
from bayesgrasp.lift.bullet.model_frames import bullet_quaternion, geom_pose, pose_matrix, rotation_matrix
from bayesgrasp.robot.physics_scene import OBJECT_BODY, TABLE_GEOM

MARGIN = 0.001
"""Metres."""

Points = Float64[np.ndarray, "_ 3"]


def add_table(client: Client, model: mujoco.MjModel) -> int:
    """The table plane; its number."""
    normal = rotation_matrix(model.geom(TABLE_GEOM).quat)[:, 2].tolist()
    plane = client.createCollisionShape(client.GEOM_PLANE, planeNormal=normal)
    body = client.createMultiBody(0, plane, basePosition=model.geom(TABLE_GEOM).pos.tolist())
    client.changeDynamics(body, -1, lateralFriction=1.0, spinningFriction=0.0, rollingFriction=0.0, restitution=0.0)
    return int(body)


class BulletObject:
    """The object as a free body: convex hulls, mass and frictions as the model has them at the moment.

    Args:
        client: Where it is made.
        model: With the object.
        hulls: See `hulls_file`.
        scale: Of the hulls.
    """

    def __init__(self, client: Client, model: mujoco.MjModel, hulls: str, scale: float) -> None:
        self.client, self.model = client, model
        item = model.body(OBJECT_BODY)
        self._inertial = pose_matrix(item.ipos, item.iquat)
        self._inertial_inverse = np.linalg.inv(self._inertial)
        shape = _load_hulls(client, hulls, scale)
        self.body = client.createMultiBody(
            float(item.mass[0]),
            shape,
            baseInertialFramePosition=item.ipos.tolist(),
            baseInertialFrameOrientation=bullet_quaternion(rotation_matrix(item.iquat)),
        )
        lateral, spinning, _ = model.geom_friction[item.geomadr[0]].tolist()
        client.changeDynamics(
            self.body,
            -1,
            localInertiaDiagonal=item.inertia.tolist(),
            lateralFriction=lateral,
            spinningFriction=spinning,
            rollingFriction=0.0,
            restitution=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
        )

    def put(self, pose: Float64[np.ndarray, "7"]) -> None:
        """Place the object's frame: position (metres) and quaternion (w, x, y, z), at rest."""
        center = pose_matrix(pose[:3], pose[3:]) @ self._inertial
        self.client.resetBasePositionAndOrientation(
            self.body, center[:3, 3].tolist(), bullet_quaternion(center[:3, :3])
        )

    def pose(self) -> Float64[np.ndarray, "7"]:
        """Pose of the object's frame, as for `put`."""
        position, (x, y, z, w) = self.client.getBasePositionAndOrientation(self.body)
        frame = pose_matrix(np.array(position), np.array([w, x, y, z])) @ self._inertial_inverse
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(frame[:3, :3]).ravel())
        return np.concatenate([frame[:3, 3], quaternion])


def hulls_file(model: mujoco.MjModel) -> str:
    """The object's parts as they are in the model, eroded by `MARGIN`, as a Wavefront file of one group for each."""
    lines: list[str] = []
    count = 1
    for number, geom in enumerate(np.flatnonzero(model.geom_bodyid == model.body(OBJECT_BODY).id)):
        mesh = model.geom_dataid[geom]
        rows = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
        pose = geom_pose(model, int(geom))
        points = eroded(model.mesh_vert[rows].astype(np.float64) @ pose[:3, :3].T + pose[:3, 3], MARGIN)
        lines.append(f"o part_{number}")
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (ConvexHull(points).simplices + count).tolist()]
        count += len(points)
    return "\n".join(lines) + "\n"


def eroded(points: Points, depth: float) -> Points:
    """Corners of the convex hull of some points with every face moved inwards by ``depth`` metres.

    A hull too thin for that is returned as it is.
    """
    hull = ConvexHull(points)
    faces = hull.equations.copy()
    faces[:, 3] += depth
    inside = points[hull.vertices].mean(axis=0)
    if (faces[:, :3] @ inside + faces[:, 3]).max() > -depth:
        return points[hull.vertices]
    try:
        corners = HalfspaceIntersection(faces, inside).intersections
        return corners[ConvexHull(corners).vertices]
    except QhullError:
        return points[hull.vertices]


def _load_hulls(client: Client, hulls: str, scale: float) -> int:
    """PyBullet makes a shape of several hulls from a file only."""
    with tempfile.TemporaryDirectory(prefix="bayesgrasp-") as folder:
        path = Path(folder) / "hulls.obj"
        path.write_text(hulls)
        shape = client.createCollisionShape(client.GEOM_MESH, fileName=str(path), meshScale=[scale] * 3)
    if shape < 0:
        raise AssetError("PyBullet cannot read the convex parts of the object")
    return int(shape)
