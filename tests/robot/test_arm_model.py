"""The arm in physics: same kinematics, no false collisions, servos that hold a hand and respect the torque limits."""

import math

import mujoco
import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.robot.arm import HOME, ArmDescription, ur5
from bayesgrasp.robot.arm_model import ArmServo, add_arm
from bayesgrasp.seeding import generator

ARM = ur5()
LOAD = 3.0


def build(load: float = 0.0, arm: ArmDescription = ARM) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Table and arm, with a ball of the given mass (kg) at the hand frame's origin."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = 0.002
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(1.0, 1.0, 0.1))
    hand = add_arm(spec, arm)
    if load:
        hand.add_geom(name="load", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.05, 0.0, 0.0), mass=load)
    model = spec.compile()
    return model, mujoco.MjData(model)


def place(model: mujoco.MjModel, data: mujoco.MjData, q: np.ndarray) -> None:
    data.qpos[:] = q
    data.ctrl[:] = q
    mujoco.mj_forward(model, data)


def hand_position(data: mujoco.MjData) -> np.ndarray:
    return np.array(data.body("arm_hand").xpos)


@pytest.mark.parametrize("arm", [ARM, ur5((0.1, 0.2, 0.3), base_yaw=1.0)], ids=["default", "moved"])
def test_physics_and_kinematics_agree_on_the_hand_frame(arm: ArmDescription) -> None:
    model, data = build(arm=arm)
    for q in generator(0).uniform(-1.0, 1.0, (100, 6)) * np.array(arm.limits):
        place(model, data, q)
        body = data.body("arm_hand")
        expected = arm.forward_kinematics(q)
        np.testing.assert_allclose(body.xpos, expected[:3, 3], atol=1e-9)
        np.testing.assert_allclose(body.xmat.reshape(3, 3), expected[:3, :3], atol=1e-9)


def test_masses_are_the_arm_s_and_inertias_are_physical() -> None:
    model, _ = build()
    names = [f"arm_{k}" for k in range(1, 7)]
    np.testing.assert_allclose([model.body(n).mass[0] for n in names], ARM.mass, rtol=1e-9)
    for name in names:
        inertia = np.sort(model.body(name).inertia)
        assert inertia[0] > 0
        assert inertia[0] + inertia[1] >= inertia[2]


def test_limits_reach_the_model_in_radians() -> None:
    model, _ = build()
    np.testing.assert_allclose(model.jnt_range[:, 1], ARM.limits)
    np.testing.assert_allclose(model.actuator_ctrlrange[:, 1], ARM.limits)
    np.testing.assert_allclose(model.actuator_forcerange[:, 1], ARM.torque)
    assert [model.joint(k).name for k in range(6)] == [f"arm_{k}" for k in range(1, 7)]
    assert [model.actuator(k).name for k in range(6)] == [f"arm_{k}" for k in range(1, 7)]


def test_nothing_collides_at_home() -> None:
    model, data = build()
    place(model, data, np.array(HOME))
    assert data.ncon == 0


def test_elbow_up_solutions_above_the_table_do_not_collide() -> None:
    model, data = build()
    rng = generator(1)
    for _ in range(60):
        pose = ARM.forward_kinematics(np.array(HOME))
        pose[:3, 3] = rng.uniform((-0.15, -0.15, 0.25), (0.15, 0.15, 0.45))
        q = ARM.inverse_kinematics(pose)[0]
        place(model, data, q)
        assert data.ncon == 0, f"contacts at {q}"


@pytest.mark.parametrize(
    ("q", "pair"),
    [((0.0, -1.5, 3.1, 0.0, 0.0, 0.0), {"arm_1", "arm_3"}), ((0.0, 0.5, 0.0, 0.0, 0.0, 0.0), {"world", "arm_3"})],
    ids=["folded onto itself", "through the table"],
)
def test_true_collisions_are_seen(q: tuple[float, ...], pair: set[str]) -> None:
    model, data = build()
    place(model, data, np.array(q))
    pairs = [{model.body(model.geom_bodyid[geom]).name for geom in (c.geom1, c.geom2)} for c in data.contact]
    assert pair in pairs


@pytest.mark.parametrize("reach", [0.0, 0.25], ids=["near", "far"])
def test_holds_a_hand_against_gravity(reach: float) -> None:
    model, data = build(LOAD)
    pose = ARM.forward_kinematics(np.array(HOME))
    pose[0, 3] += reach
    q = ARM.inverse_kinematics(pose)[0]
    place(model, data, q)
    start = hand_position(data)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.linalg.norm(hand_position(data) - start) < 0.001
    assert np.abs(data.qvel).max() < 1e-3


def test_follows_a_straight_lift() -> None:
    """0.2 m in one second with a 3 kg hand: the servos' lag on the way, within 1 mm at the end."""
    model, data = build(LOAD)
    pose = ARM.forward_kinematics(np.array(HOME))
    pose[2, 3] -= 0.2
    q = ARM.inverse_kinematics(pose)[0]
    place(model, data, q)
    errors = []
    for step in range(700):
        pose[2, 3] += 0.2 * 0.002 if step < 500 else 0.0
        q = ARM.inverse_kinematics(pose, q)[0]
        data.ctrl[:] = q
        mujoco.mj_step(model, data)
        errors.append(np.linalg.norm(hand_position(data) - pose[:3, 3]))
    lag = ArmServo().damping[0] / ArmServo().stiffness[0]
    assert max(errors) < 1.2 * 0.2 * lag
    assert errors[-1] < 0.001


def test_torques_stay_within_the_limits_when_the_command_jumps() -> None:
    model, data = build(LOAD)
    place(model, data, np.array(HOME))
    data.ctrl[:] = np.array(HOME) + 0.5
    peak = np.zeros(6)
    for _ in range(200):
        mujoco.mj_step(model, data)
        peak = np.maximum(peak, np.abs(data.actuator_force))
    assert (peak <= np.array(ARM.torque) + 1e-9).all()
    assert (peak[:3] > 0.5 * np.array(ARM.torque[:3])).all()
    assert np.isfinite(data.qpos).all()


def test_home_leaves_the_camera_a_free_view() -> None:
    """No point of a link, nor of a hand 0.2 m long, is inside the image."""
    model, data = build()
    place(model, data, np.array(HOME))
    camera = canonical_camera()
    ends = [hand_position(data), hand_position(data) - np.array([0.0, 0.0, 0.2])]
    for geom in range(model.ngeom):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE and model.geom_bodyid[geom] > 1:
            axis = data.geom_xmat[geom].reshape(3, 3)[:, 2] * model.geom_size[geom, 1]
            ends += [data.geom_xpos[geom] - axis, data.geom_xpos[geom] + axis]
    pixels, depth = camera.project(np.array(ends))
    inside = (depth > 0) & (pixels >= 0).all(-1) & (pixels[:, 0] < camera.width) & (pixels[:, 1] < camera.height)
    assert not inside.any(), np.array(ends)[inside]


def test_a_specification_in_degrees_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="degree"):
        add_arm(mujoco.MjSpec(), ARM)


@pytest.mark.parametrize("name", ["stiffness", "damping", "armature"])
def test_servo_refuses_nonsense(name: str) -> None:
    with pytest.raises(InvalidConfigurationError, match=name):
        ArmServo(**{name: (1.0, 1.0, 1.0, 1.0, 1.0, math.nan)})
