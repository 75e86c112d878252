"""The scene of the lift test in PyBullet, translated from the compiled MuJoCo model: no number is stated here twice.

The robot becomes one multi-body in reduced coordinates (Featherstone), with a link for every body that has mass:
frames, inertias, shapes, joint axes, stops and the pairs that never collide are the model's. The object becomes a free
body with one convex hull for each of its parts. Three things have no counterpart in PyBullet:

* A rotor's inertia (armature) is added to its link's inertia about the joint's axis.
* Hulls carry a skin of `MARGIN`, which the engine adds outside: parts are eroded by it first, so that hull and skin
  together are the part again (a part too thin for that stays as it is).
* PyBullet multiplies the two frictions of a contact; MuJoCo takes the object's. So robot and table have friction 1.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from bayesgrasp.assets.scene import OBJECT_BODY, TABLE_GEOM
from bayesgrasp.errors import AssetError
from bayesgrasp.simulators.engine import Collidable

MARGIN = 0.001
"""Metres: PyBullet's own skin around convex hulls, inside which contacts are found without penetration."""

Points = Float64[np.ndarray, "_ 3"]


class Client:
    """A connection to PyBullet: its functions, each called with the connection's number."""

    def __init__(self, module: ModuleType, number: int) -> None:
        self.module, self.number = module, number

    def __getattr__(self, name: str) -> Any:
        function, number = getattr(self.module, name), self.number
        if not callable(function):
            return function
        self.__dict__[name] = bound = lambda *args, **kwargs: function(*args, physicsClientId=number, **kwargs)
        return bound


class BulletRobot:
    """Arm and hand as one multi-body with a fixed base.

    Args:
        client: Where it is made.
        model: With arm and hand, and an object that is left out.
    """

    def __init__(self, client: Client, model: mujoco.MjModel) -> None:
        self.client, self.model = client, model
        self.links = _moving_bodies(model)
        self._frames = _frames_at_zero(model)
        columns = [self._link(body) for body in self.links]
        static = [g for g in range(model.ngeom) if self._is_static(int(model.geom_bodyid[g]))]
        self.body = client.createMultiBody(
            baseMass=0,
            baseCollisionShapeIndex=self._shape(static, None),
            flags=client.URDF_USE_SELF_COLLISION,
            **{name: [column[name] for column in columns] for name in columns[0]},
        )
        self.joints = [k for k, body in enumerate(self.links) if model.body_jntnum[body]]
        for link, body in enumerate(self.links):
            self._set_dynamics(link, body)
        self._set_dynamics(-1, None)
        self._forbid_contacts()
        self._free_motors()

    def _is_static(self, body: int) -> bool:
        return body != 0 and self.model.body_weldid[body] == 0

    def _parent(self, body: int) -> int | None:
        """The link above a body, by its place in `links`; None for the base."""
        above = int(self.model.body_parentid[body])
        while above not in self.links:
            if self.model.body_weldid[above] == 0:
                return None
            above = int(self.model.body_parentid[above])
        return self.links.index(above)

    def _link(self, body: int) -> dict[str, Any]:
        model, parent = self.model, self._parent(body)
        reference = np.eye(4) if parent is None else self._frames[self.links[parent]]
        pose = np.linalg.inv(reference) @ self._frames[body]
        hinge = model.body_jntnum[body] > 0
        axes = self._inertia(body)[1]
        return {
            "linkMasses": float(model.body_mass[body]),
            "linkCollisionShapeIndices": self._shape(np.flatnonzero(model.geom_bodyid == body), body),
            "linkVisualShapeIndices": -1,
            "linkPositions": pose[:3, 3].tolist(),
            "linkOrientations": _quaternion(pose[:3, :3]),
            "linkInertialFramePositions": model.body_ipos[body].tolist(),
            "linkInertialFrameOrientations": _quaternion(axes),
            "linkParentIndices": 0 if parent is None else parent + 1,
            "linkJointTypes": self.client.JOINT_REVOLUTE if hinge else self.client.JOINT_FIXED,
            "linkJointAxis": model.jnt_axis[model.body_jntadr[body]].tolist() if hinge else [0.0, 0.0, 1.0],
        }

    def _inertia(self, body: int) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]]:
        """Principal moments (kg m^2) and axes (columns, in the link's frame), with the rotor's inertia."""
        model = self.model
        axes = _matrix(model.body_iquat[body])
        tensor = axes @ np.diag(model.body_inertia[body]) @ axes.T
        for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            axis = model.jnt_axis[joint]
            tensor += model.dof_armature[model.jnt_dofadr[joint]] * np.outer(axis, axis)
        moments, axes = np.linalg.eigh(tensor)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        return moments, axes

    def _shape(self, geoms: Any, body: int | None) -> int:
        """A collision shape of boxes and capsules, in the frame of their body (None: the world)."""
        client, model = self.client, self.model
        if len(geoms) == 0:
            return -1
        poses = [_geom_pose(model, g) if body is not None else self._world_pose(g) for g in geoms]
        sizes = model.geom_size[geoms]
        capsule = model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_CAPSULE
        return client.createCollisionShapeArray(
            shapeTypes=[client.GEOM_CAPSULE if c else client.GEOM_BOX for c in capsule],
            radii=sizes[:, 0].tolist(),
            lengths=(2.0 * sizes[:, 1]).tolist(),
            halfExtents=sizes.tolist(),
            collisionFramePositions=[pose[:3, 3].tolist() for pose in poses],
            collisionFrameOrientations=[_quaternion(pose[:3, :3]) for pose in poses],
        )

    def _world_pose(self, geom: int) -> Float64[np.ndarray, "4 4"]:
        return self._frames[self.model.geom_bodyid[geom]] @ _geom_pose(self.model, geom)

    def _set_dynamics(self, link: int, body: int | None) -> None:
        stops: dict[str, float] = {}
        inertia: dict[str, list[float]] = {}
        if body is not None:
            inertia["localInertiaDiagonal"] = self._inertia(body)[0].tolist()
            if self.model.body_jntnum[body]:
                low, high = self.model.jnt_range[self.model.body_jntadr[body]].tolist()
                stops = {"jointLowerLimit": low, "jointUpperLimit": high}
        self.client.changeDynamics(
            self.body,
            link,
            lateralFriction=1.0,
            spinningFriction=0.0,
            rollingFriction=0.0,
            restitution=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            jointDamping=0.0,
            **inertia,
            **stops,
        )

    def _forbid_contacts(self) -> None:
        collidable = Collidable(self.model)
        static = [body for body in range(self.model.nbody) if self._is_static(body)]
        for one, first in enumerate(self.links):
            if not any(collidable(first, body) for body in static):
                self.client.setCollisionFilterPair(self.body, self.body, one, -1, 0)
            for other, second in enumerate(self.links[:one]):
                if not collidable(first, second):
                    self.client.setCollisionFilterPair(self.body, self.body, one, other, 0)

    def _free_motors(self) -> None:
        """Joints come with velocity motors switched on; ours are torques."""
        zeros = [0.0] * len(self.joints)
        self.client.setJointMotorControlArray(self.body, self.joints, self.client.VELOCITY_CONTROL, forces=zeros)


def add_table(client: Client, model: mujoco.MjModel) -> int:
    """The table plane; its number."""
    normal = _matrix(model.geom(TABLE_GEOM).quat)[:, 2].tolist()
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
        self._inertial = _pose(item.ipos, item.iquat)
        self._inertial_inverse = np.linalg.inv(self._inertial)
        shape = _load_hulls(client, hulls, scale)
        self.body = client.createMultiBody(
            float(item.mass[0]),
            shape,
            baseInertialFramePosition=item.ipos.tolist(),
            baseInertialFrameOrientation=_quaternion(_matrix(item.iquat)),
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
        center = _pose(pose[:3], pose[3:]) @ self._inertial
        self.client.resetBasePositionAndOrientation(self.body, center[:3, 3].tolist(), _quaternion(center[:3, :3]))

    def pose(self) -> Float64[np.ndarray, "7"]:
        """Pose of the object's frame, as for `put`."""
        position, (x, y, z, w) = self.client.getBasePositionAndOrientation(self.body)
        frame = _pose(np.array(position), np.array([w, x, y, z])) @ self._inertial_inverse
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
        pose = _geom_pose(model, int(geom))
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


def _moving_bodies(model: mujoco.MjModel) -> list[int]:
    item = model.body(OBJECT_BODY).id
    return [b for b in range(1, model.nbody) if b != item and model.body_weldid[b] != 0 and model.body_mass[b] > 0]


def _frames_at_zero(model: mujoco.MjModel) -> Float64[np.ndarray, "bodies 4 4"]:
    """Poses of all bodies in the world where every joint angle is zero."""
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    data.qpos[model.jnt_qposadr[model.body(OBJECT_BODY).jntadr[0]] + 3] = 1.0
    mujoco.mj_kinematics(model, data)
    frames = np.zeros((model.nbody, 4, 4))
    frames[:, :3, :3], frames[:, :3, 3], frames[:, 3, 3] = data.xmat.reshape(-1, 3, 3), data.xpos, 1.0
    return frames


def _geom_pose(model: mujoco.MjModel, geom: int) -> Float64[np.ndarray, "4 4"]:
    return _pose(model.geom_pos[geom], model.geom_quat[geom])


def _pose(position: Float64[np.ndarray, "3"], quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "4 4"]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = _matrix(quaternion), position
    return pose


def _matrix(quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "3 3"]:
    """Rotation matrix of a quaternion (w, x, y, z)."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _quaternion(matrix: Float64[np.ndarray, "3 3"]) -> list[float]:
    """Quaternion of a rotation matrix in PyBullet's order (x, y, z, w)."""
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(matrix).ravel())
    return np.roll(quaternion, -1).tolist()
