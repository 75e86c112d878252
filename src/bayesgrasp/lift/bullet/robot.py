"""Arm and hand in PyBullet, translated from the compiled MuJoCo model.

The robot becomes one multi-body in reduced coordinates (Featherstone), with a link for every body that has mass:
frames, inertias, shapes, joint axes, stops and the pairs that never collide are the model's. Two things have no
counterpart in PyBullet:

* A rotor's inertia (armature) is added to its link's inertia about the joint's axis, of a slide to its mass.
* PyBullet multiplies the two frictions of a contact; MuJoCo takes the object's. So robot and table have friction 1.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float64

from bayesgrasp.lift.bullet.client import Client
from bayesgrasp.lift.bullet.collision_rules import CollisionRules
from bayesgrasp.lift.bullet.model_frames import bullet_quaternion, geom_pose, rotation_matrix
from bayesgrasp.robot.physics_scene import OBJECT_BODY


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
        return body != 0 and int(self.model.body_weldid[body]) == 0

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
        kind, axis = self._joint(body)
        axes = self._inertia(body)[1]
        return {
            "linkMasses": self._mass(body),
            "linkCollisionShapeIndices": self._shape(np.flatnonzero(model.geom_bodyid == body).tolist(), body),
            "linkVisualShapeIndices": -1,
            "linkPositions": pose[:3, 3].tolist(),
            "linkOrientations": bullet_quaternion(pose[:3, :3]),
            "linkInertialFramePositions": model.body_ipos[body].tolist(),
            "linkInertialFrameOrientations": bullet_quaternion(axes),
            "linkParentIndices": 0 if parent is None else parent + 1,
            "linkJointTypes": kind,
            "linkJointAxis": axis,
        }

    def _is_slide(self, body: int) -> bool:
        first = self.model.body_jntadr[body]
        return bool(self.model.body_jntnum[body] and self.model.jnt_type[first] == mujoco.mjtJoint.mjJNT_SLIDE)

    def _joint(self, body: int) -> tuple[int, list[float]]:
        """Type and axis of the joint that moves a link."""
        if not self.model.body_jntnum[body]:
            return int(self.client.JOINT_FIXED), [0.0, 0.0, 1.0]
        kind = self.client.JOINT_PRISMATIC if self._is_slide(body) else self.client.JOINT_REVOLUTE
        return int(kind), self.model.jnt_axis[self.model.body_jntadr[body]].tolist()

    def _mass(self, body: int) -> float:
        """Of a link, kg, with the inertia of a slide's rotor."""
        mass = float(self.model.body_mass[body])
        if self._is_slide(body):
            mass += float(self.model.dof_armature[self.model.body_dofadr[body]])
        return mass

    def _inertia(self, body: int) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]]:
        """Principal moments (kg m^2) and axes (columns, in the link's frame), with the rotor's inertia."""
        model = self.model
        axes = rotation_matrix(model.body_iquat[body])
        tensor = axes @ np.diag(model.body_inertia[body]) @ axes.T
        for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
                continue  # it is added to the mass
            axis = model.jnt_axis[joint]
            tensor += model.dof_armature[model.jnt_dofadr[joint]] * np.outer(axis, axis)
        moments, axes = np.linalg.eigh(tensor)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        return moments, axes

    def _shape(self, geoms: list[int], body: int | None) -> int:
        """A collision shape of boxes and capsules, in the frame of their body (None: the world)."""
        client, model = self.client, self.model
        if not geoms:
            return -1
        poses = [geom_pose(model, g) if body is not None else self._world_pose(g) for g in geoms]
        sizes = model.geom_size[geoms]
        capsule = model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_CAPSULE
        shape: int = client.createCollisionShapeArray(
            shapeTypes=[client.GEOM_CAPSULE if c else client.GEOM_BOX for c in capsule],
            radii=sizes[:, 0].tolist(),
            lengths=(2.0 * sizes[:, 1]).tolist(),
            halfExtents=sizes.tolist(),
            collisionFramePositions=[pose[:3, 3].tolist() for pose in poses],
            collisionFrameOrientations=[bullet_quaternion(pose[:3, :3]) for pose in poses],
        )
        return shape

    def _world_pose(self, geom: int) -> Float64[np.ndarray, "4 4"]:
        pose: Float64[np.ndarray, "4 4"] = self._frames[self.model.geom_bodyid[geom]] @ geom_pose(self.model, geom)
        return pose

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
        rules = CollisionRules(self.model)
        static = [body for body in range(self.model.nbody) if self._is_static(body)]
        for one, first in enumerate(self.links):
            if not any(rules.allow(first, body) for body in static):
                self.client.setCollisionFilterPair(self.body, self.body, one, -1, 0)
            for other, second in enumerate(self.links[:one]):
                if not rules.allow(first, second):
                    self.client.setCollisionFilterPair(self.body, self.body, one, other, 0)

    def _free_motors(self) -> None:
        """Joints come with velocity motors switched on; ours are torques."""
        zeros = [0.0] * len(self.joints)
        self.client.setJointMotorControlArray(self.body, self.joints, self.client.VELOCITY_CONTROL, forces=zeros)


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
