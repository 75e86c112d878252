"""The physics scene: table, object, hand and arm as one MuJoCo model, and its cheap change of object between attempts.

Scale, mass and friction of the object change with every attempt. Compiling a model takes a hundred times longer than
screening an attempt, so a scene is compiled once per mesh at scale 1 and `ObjectHandle.set` writes the few arrays that
depend on them: lengths grow with beta, masses with beta^3, inertias with beta^5. A test compares the result with a
model compiled at that scale.

Contacts: elliptic friction cone with the object's friction for every contact of the object (it has priority), and
torsional friction about the contact normal (condim 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.objects.object_asset import ObjectAsset

OBJECT_BODY = "object"
TABLE_GEOM = "table"
_ROLLING_FRICTION = 1e-4
ELASTIC_TIME = 0.006
"""Time constant of contacts and stops, seconds; they are critically damped (MuJoCo's solref)."""


@dataclass(frozen=True)
class PhysicsConfig:
    """Numerics of the physics engine.

    Attributes:
        time_step: Seconds.
        friction_ratio: Ratio of frictional to normal constraint impedance (MuJoCo's impratio); prevents slow slip.
        solver_iterations: At most, per step.
    """

    time_step: float = 0.002
    friction_ratio: float = 10.0
    solver_iterations: int = 50

    def __post_init__(self) -> None:
        if not 0 < self.time_step <= 0.01:
            raise InvalidConfigurationError(f"time_step must be in (0, 0.01] s, got {self.time_step}")
        if self.friction_ratio < 1 or self.solver_iterations < 1:
            raise InvalidConfigurationError("friction_ratio and solver_iterations must be at least 1")


def new_spec(config: PhysicsConfig = PhysicsConfig()) -> mujoco.MjSpec:
    """An empty world with the table plane and the engine's options."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = config.time_step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = config.friction_ratio
    spec.option.iterations = config.solver_iterations
    spec.worldbody.add_geom(
        name=TABLE_GEOM, type=mujoco.mjtGeom.mjGEOM_PLANE, size=(2.0, 2.0, 0.1), rgba=(0.75, 0.7, 0.62, 1.0)
    )
    return spec


def add_object(spec: mujoco.MjSpec, asset: ObjectAsset) -> None:
    """Add an object as a free body made of its convex parts, with its catalogue mass, at scale 1."""
    body = spec.worldbody.add_body(name=OBJECT_BODY)
    body.add_freejoint(name=OBJECT_BODY)
    body.explicitinertial = True
    body.mass = asset.mass_kg
    body.ipos = asset.center_of_mass
    body.fullinertia = _upper_triangle(asset.mass_kg * asset.inertia)
    for index, part in enumerate(asset.parts):
        name = f"part_{index}"
        spec.add_mesh(name=name, uservert=part.vertices.ravel(), userface=part.faces.ravel())
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            condim=4,
            priority=1,
            solref=(ELASTIC_TIME, 1.0),
            rgba=(0.85, 0.45, 0.25, 1.0),
        )


def _upper_triangle(inertia: Float64[np.ndarray, "3 3"]) -> list[float]:
    i = inertia
    return [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]


@dataclass(frozen=True)
class ObjectState:
    """How an object stands on the table in one attempt.

    Attributes:
        pose: Position (metres) and quaternion (w, x, y, z) of its frame in the world.
        scale: beta (-).
        mass_factor: Mass relative to catalogue mass * scale^3 (-).
        lateral_friction: Of all its contacts (-).
        spinning_friction: Likewise, metres.
    """

    pose: Float64[np.ndarray, "7"]
    scale: float
    mass_factor: float
    lateral_friction: float
    spinning_friction: float


class ObjectHandle:
    """The object inside a compiled model: its addresses, and the arrays at scale 1 from which others follow."""

    _LENGTHS = ("geom_pos", "geom_size", "geom_aabb", "geom_rbound")

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self.scale = 1.0
        self.body = model.body(OBJECT_BODY).id
        self.geoms = np.flatnonzero(model.geom_bodyid == self.body)
        joint = model.body_jntadr[self.body]
        self.qpos = slice(model.jnt_qposadr[joint], model.jnt_qposadr[joint] + 7)
        self.qvel = slice(model.jnt_dofadr[joint], model.jnt_dofadr[joint] + 6)
        meshes = model.geom_dataid[self.geoms]
        first, last = meshes.min(), meshes.max()
        self._vertices = slice(model.mesh_vertadr[first], model.mesh_vertadr[last] + model.mesh_vertnum[last])
        tree = model.body_bvhadr[self.body]
        self._tree = slice(tree, tree + model.body_bvhnum[self.body])
        self._base = self._snapshot()
        reach = np.linalg.norm(model.geom_pos[self.geoms], axis=1) + model.geom_rbound[self.geoms]
        self._radius = float(reach.max())

    @property
    def radius(self) -> float:
        """No point of the object is farther from the origin of its frame; metres."""
        return self.scale * self._radius

    def _snapshot(self) -> dict[str, np.ndarray]:
        m = self.model
        base = {name: getattr(m, name)[self.geoms].copy() for name in self._LENGTHS}
        base["mesh_vert"] = m.mesh_vert[self._vertices].copy()
        base["bvh_aabb"] = m.bvh_aabb[self._tree].copy()
        base["ipos"] = m.body_ipos[self.body].copy()
        base["mass"] = m.body_mass[self.body].copy()
        base["inertia"] = m.body_inertia[self.body].copy()
        base["invweight"] = m.body_invweight0[self.body].copy()
        base["dof_invweight"] = m.dof_invweight0[self.qvel].copy()
        return base

    def put(self, data: mujoco.MjData, state: ObjectState) -> None:
        """Let the object be and stand as a state says."""
        self.set(state.scale, state.mass_factor, state.lateral_friction, state.spinning_friction)
        data.qpos[self.qpos] = state.pose

    def set(self, scale: float, mass_factor: float, lateral_friction: float, spinning_friction: float) -> None:
        """Give the object a scale (-), a mass relative to catalogue mass * scale^3 (-), and frictions (-, metres)."""
        m, base = self.model, self._base
        self.scale = scale
        for name in self._LENGTHS:
            getattr(m, name)[self.geoms] = scale * base[name]
        m.mesh_vert[self._vertices] = scale * base["mesh_vert"]
        m.bvh_aabb[self._tree] = scale * base["bvh_aabb"]
        m.body_ipos[self.body] = scale * base["ipos"]
        mass, inertia = mass_factor * scale**3, mass_factor * scale**5
        m.body_mass[self.body] = mass * base["mass"]
        m.body_inertia[self.body] = inertia * base["inertia"]
        # What a unit of force or torque at the object moves, which softens its contacts: the inverse of the above.
        m.body_invweight0[self.body] = base["invweight"] / (mass, inertia)
        m.dof_invweight0[self.qvel] = base["dof_invweight"] / ([mass] * 3 + [inertia] * 3)
        m.geom_friction[self.geoms] = (lateral_friction, spinning_friction, _ROLLING_FRICTION)


def planar_pose(x: float, y: float, yaw: float) -> Float64[np.ndarray, "7"]:
    """Position and quaternion (w, x, y, z) of the object frame in the world for a planar pose (metres, radians)."""
    return np.array([x, y, 0.0, np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)])
