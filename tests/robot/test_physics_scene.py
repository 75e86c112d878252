"""Changing an object inside a compiled model gives the model that would have been compiled."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.meshes.convex import ConvexPart
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.robot.physics_scene import ObjectHandle, PhysicsConfig, add_object, new_spec, planar_pose


def _compiled(asset: ObjectAsset) -> mujoco.MjModel:
    spec = new_spec()
    add_object(spec, asset)
    return spec.compile()


def _scaled(asset: ObjectAsset, scale: float, mass_factor: float) -> ObjectAsset:
    return replace(
        asset,
        mass_kg=asset.mass_kg * mass_factor * scale**3,
        parts=tuple(ConvexPart(scale * part.vertices, part.faces) for part in asset.parts),
        center_of_mass=scale * asset.center_of_mass,
        inertia=scale**2 * asset.inertia,
    )


@pytest.mark.parametrize(("scale", "mass_factor"), [(0.9, 1.1), (1.1, 0.9), (1.0, 1.0)])
def test_set_equals_compiling_the_scaled_object(scale: float, mass_factor: float) -> None:
    (asset,) = load_objects(["household_coffee_mug"])
    model = _compiled(asset)
    handle = ObjectHandle(model)
    handle.set(1.07, 0.5, 0.3, 0.001)  # whatever was before must not matter
    handle.set(scale, mass_factor, 0.7, 0.004)
    expected = _compiled(_scaled(asset, scale, mass_factor))
    for name in ("geom_pos", "geom_size", "geom_aabb", "geom_rbound", "mesh_vert", "body_mass", "body_inertia"):
        np.testing.assert_allclose(getattr(model, name), getattr(expected, name), rtol=1e-4, atol=1e-6, err_msg=name)
    for name in ("body_ipos", "body_invweight0", "dof_invweight0"):
        np.testing.assert_allclose(getattr(model, name), getattr(expected, name), rtol=1e-4, atol=1e-6, err_msg=name)
    np.testing.assert_allclose(model.geom_friction[handle.geoms], [[0.7, 0.004, 1e-4]] * len(handle.geoms))


def test_an_object_rests_where_it_is_put() -> None:
    (asset,) = load_objects(["household_coffee_mug"])
    model = _compiled(asset)
    data = mujoco.MjData(model)
    handle = ObjectHandle(model)
    handle.set(1.1, 1.0, 0.8, 0.004)
    pose = planar_pose(0.03, -0.02, 1.0)
    data.qpos[handle.qpos] = pose
    mujoco.mj_step(model, data, 500)
    np.testing.assert_allclose(data.qpos[handle.qpos], pose, atol=2e-3)


def test_the_cone_is_elliptic() -> None:
    assert new_spec().option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC


@pytest.mark.parametrize("wrong", [{"time_step": 0.0}, {"friction_ratio": 0.5}, {"solver_iterations": 0}])
def test_wrong_physics_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidConfigurationError):
        PhysicsConfig(**wrong)
