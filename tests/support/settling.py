"""Whether an object stays where it is put, in the physics engine alone."""

import mujoco
import numpy as np

from bayesgrasp.objects.object_asset import ObjectAsset


def settle(asset: ObjectAsset) -> tuple[float, float]:
    """Metres and degrees that it moves in half a second on a table."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1], friction=[0.8, 0.005, 1e-4])
    body = spec.worldbody.add_body(name="object", mass=asset.mass_kg, ipos=asset.center_of_mass)
    body.explicitinertial = True
    i = asset.mass_kg * asset.inertia
    body.fullinertia = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    body.add_freejoint()
    for index, part in enumerate(asset.parts):
        spec.add_mesh(name=str(index), uservert=part.vertices.ravel(), userface=part.faces.ravel())
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=str(index), friction=[0.8, 0.005, 1e-4])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=250)
    turn = 2 * np.degrees(np.arccos(min(1.0, abs(data.qpos[3]))))
    return float(np.linalg.norm(data.qpos[:3])), float(turn)
