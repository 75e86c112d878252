"""The second engine: the same scene in both, sane grasps, outcomes that depend on the attempt alone, nothing left over.

Attempts are `draw_attempts` of a prior only where that is said; others are grasps that anybody would agree about.
"""

import subprocess
import sys
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.lift.attempt import Attempt
from bayesgrasp.lift.bullet.bullet_engine import BulletConfig, BulletEngine
from bayesgrasp.lift.bullet.item import MARGIN, eroded
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.robot.physics_scene import ObjectState, planar_pose
from bayesgrasp.types import Attempts, GraspType, Outcome

pytest.importorskip("pybullet", reason="the second engine is the optional extra bayesgrasp[pybullet]")

OPEN_HAND = 0.19
"""Height of a palm from which the fingertips just clear the table, metres."""
OBJECTS = ("household_drink_can", "household_tea_box")


@pytest.fixture(scope="module")
def objects() -> tuple[ObjectAsset, ...]:
    return load_objects(OBJECTS)


@pytest.fixture(scope="module")
def tests(objects: tuple[ObjectAsset, ...]) -> dict[str, LiftTest]:
    return {"mujoco": LiftTest(objects), "pybullet": LiftTest(objects, LiftTestConfig(engine="pybullet"))}


def grasp(x: float = 0.0, y: float = 0.0, z: float = OPEN_HAND, index: int = 1, friction: float = 0.8) -> Attempts:
    """A hand that looks down, with fingers b and c opposite the thumb."""
    one = np.ones(1, np.float32)
    return Attempts(
        position=np.array([[x, y, z]], np.float32),
        quaternion=np.array([[1.0, 0.0, 1.0, 0.0]], np.float32),
        grasp_type=np.array([GraspType.BASIC], np.uint8),
        object_index=np.array([index], np.int32),
        scale=one,
        object_pose=np.zeros((1, 3), np.float32),
        lateral_friction=friction * one,
        spinning_friction=0.004 * one,
        mass_factor=one,
    )


def top(objects: tuple[ObjectAsset, ...], index: int) -> float:
    """Height of the palm over an object, metres."""
    return max(OPEN_HAND, float(objects[index].vertices[:, 2].max()) + 0.07)


def started(lift_test: LiftTest, attempt: Attempts) -> BulletEngine:
    """The engine with the world of an attempt, at home above it, before any step."""
    rig = lift_test.benches[int(attempt.object_index[0])].rig
    item = ObjectState(planar_pose(0.05, -0.02, 0.6), float(attempt.scale[0]), 1.3, 0.7, 0.003)
    rig.prepare(Attempt(GraspType.WIDE, np.eye(4), item))
    rig.set_arm(np.array(lift_test.arm.home) + 0.2)
    mujoco.mj_kinematics(rig.model, rig.data)
    rig.engine.start()
    assert isinstance(rig.engine, BulletEngine)
    return rig.engine


def test_both_engines_have_the_same_bodies(tests: dict[str, LiftTest]) -> None:
    attempt = replace(grasp(), scale=np.full(1, 1.1, np.float32))
    engine = started(tests["pybullet"], attempt)
    client, model, data = engine.client, engine.model, engine.data
    for link, body in enumerate(engine.robot.links):
        state = client.getLinkState(engine.robot.body, link, computeForwardKinematics=1)
        np.testing.assert_allclose(state[0], data.xipos[body], atol=1e-6)
        np.testing.assert_allclose(state[4], data.xpos[body], atol=1e-6)
        rotation = np.array(client.module.getMatrixFromQuaternion(state[5])).reshape(3, 3)
        np.testing.assert_allclose(rotation, data.xmat[body].reshape(3, 3), atol=1e-6)
        assert client.getDynamicsInfo(engine.robot.body, link)[0] == pytest.approx(model.body_mass[body])
    item = engine.object.body
    mass, friction, inertia = client.getDynamicsInfo(item, -1)[:3]
    assert mass == pytest.approx(float(model.body("object").mass[0]))
    assert friction == pytest.approx(0.7)
    np.testing.assert_allclose(inertia, model.body("object").inertia, rtol=1e-6)
    np.testing.assert_allclose(engine.object.pose(), data.qpos[model.joint("object").qposadr[0] :][:7], atol=1e-6)
    engine.stop()


def test_the_object_rests_on_the_table_and_keeps_its_place(tests: dict[str, LiftTest]) -> None:
    engine = started(tests["pybullet"], grasp())
    before = engine.object.pose()
    engine.advance(0.5)
    after = engine.object.pose()
    np.testing.assert_allclose(after[:3], before[:3], atol=1e-3)
    np.testing.assert_allclose(after[3:], before[3:], atol=5e-3)
    engine.stop()


def test_the_arm_stands_still_under_its_servos(tests: dict[str, LiftTest]) -> None:
    engine = started(tests["pybullet"], grasp())
    before = engine.data.qpos[:17].copy()
    engine.advance(0.3)
    np.testing.assert_allclose(engine.data.qpos[:17], before, atol=0.01)
    engine.stop()


def test_a_fingertip_stays_parallel_while_it_closes_freely(tests: dict[str, LiftTest]) -> None:
    """The parallelogram's stop and spring, and the differential, act as in the model."""
    for name, lift_test in tests.items():
        sums, last = [], {}

        def record(model: mujoco.MjModel, data: mujoco.MjData, sums: list[float] = sums, last: Any = last) -> None:
            first, second, third = (float(data.joint(f"joint_{k}_a").qpos[0]) for k in (1, 2, 3))
            if data.time < 0.9:  # before the fingers meet
                sums.append(first + second + third)
            last["first"] = first

        LiftTest(lift_test.objects, lift_test.config, screening=False).observe(grasp(z=0.45), record)
        assert np.abs(sums).max() < np.radians(2.5), name
        assert last["first"] > 0.5, name


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_a_good_grasp_succeeds_and_holds(
    tests: dict[str, LiftTest], objects: tuple[ObjectAsset, ...], engine: str
) -> None:
    for index in range(len(objects)):
        verdicts = tests[engine].judge(grasp(z=top(objects, index), index=index))
        assert verdicts.outcomes[0] == Outcome.SUCCESS, OBJECTS[index]
        assert verdicts.held[0], OBJECTS[index]


def test_an_open_hand_far_away_touches_nothing(objects: tuple[ObjectAsset, ...]) -> None:
    for name in ("mujoco", "pybullet"):
        lift_test = LiftTest(objects, LiftTestConfig(engine=name), screening=False)
        assert lift_test.run(grasp(z=0.45))[0] == Outcome.NO_CONTACT, name


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_without_friction_the_object_is_not_lifted(
    tests: dict[str, LiftTest], objects: tuple[ObjectAsset, ...], engine: str
) -> None:
    """Three fingers press with some 150 N, so the friction must be below the weight's share of that."""
    assert tests[engine].run(grasp(z=top(objects, 1), friction=0.001))[0] != Outcome.SUCCESS


def test_outcomes_do_not_depend_on_what_was_tried_before(
    tests: dict[str, LiftTest], objects: tuple[ObjectAsset, ...]
) -> None:
    def heights(lift_test: LiftTest, attempt: Attempts) -> list[float]:
        seen: list[float] = []
        lift_test.observe(attempt, lambda model, data: seen.append(float(data.body("object").xpos[2])))
        return seen

    attempt = grasp(x=0.005, z=top(objects, 0), index=0)
    first = heights(tests["pybullet"], attempt)
    tests["pybullet"].run(grasp(z=top(objects, 1)))
    assert heights(tests["pybullet"], attempt) == first
    assert heights(LiftTest(objects, tests["pybullet"].config), attempt) == first


def test_screened_attempts_need_no_physics_and_agree(tests: dict[str, LiftTest]) -> None:
    far, table, beyond = grasp(y=0.22, z=0.25), grasp(z=0.12), grasp(x=1.5, z=0.3)
    attempts = Attempts.cat([far, table, beyond])
    expected = [Outcome.NO_CONTACT, Outcome.COLLISION, Outcome.UNREACHABLE]
    for lift_test in tests.values():
        assert list(lift_test.run(attempts)) == expected


def test_divergence_is_an_outcome(objects: tuple[ObjectAsset, ...]) -> None:
    lift_test = LiftTest(objects, LiftTestConfig(engine="pybullet"))
    lift_test.benches[1].rig.model.opt.gravity[:] = (0.0, 0.0, 1e9)
    assert lift_test.run(grasp(z=top(objects, 1)))[0] == Outcome.DIVERGED


def test_nothing_is_printed_and_no_connection_is_left() -> None:
    script = (
        "import gc\n"
        "from bayesgrasp.objects.catalogue import load_objects\n"
        "from bayesgrasp.lift.lift_config import LiftTestConfig\n"
        "from bayesgrasp.lift.lift_test import LiftTest\n"
        "test = LiftTest(load_objects(['household_tea_box']), LiftTestConfig(engine='pybullet'))\n"
        "test.benches[0]\n"
        "import pybullet\n"
        "assert pybullet.isConnected(0)\n"
        "del test\n"
        "gc.collect()\n"
        "assert not pybullet.isConnected(0)\n"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stdout + result.stderr == ""


def test_a_missing_engine_is_one_clear_error(objects: tuple[ObjectAsset, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(InvalidConfigurationError, match=r"bayesgrasp\[pybullet\]"):
        LiftTest(objects, LiftTestConfig(engine="pybullet"))


def test_settings_name_what_outcomes_depend_on() -> None:
    assert set(LiftTestConfig().settings()) == {"motion", "lift", "physics"}
    changed = LiftTestConfig(bullet=BulletConfig(solver_iterations=7))
    assert changed.settings() == LiftTestConfig().settings()
    assert replace(changed, engine="pybullet").settings()["bullet"]["solver_iterations"] == 7


@pytest.mark.parametrize(
    "wrong", [{"time_step": 0.01}, {"solver_iterations": 0}, {"contact_recovery": 0.0}, {"contact_distance": 0.0}]
)
def test_wrong_numerics_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidConfigurationError):
        BulletConfig(**wrong)  # type: ignore[arg-type]


def test_eroding_a_hull_moves_every_face_inwards() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 0.04) for y in (0.0, 0.06) for z in (-0.01, 0.01)])
    inner = eroded(corners, MARGIN)
    np.testing.assert_allclose(inner.min(axis=0), corners.min(axis=0) + MARGIN, atol=1e-9)
    np.testing.assert_allclose(inner.max(axis=0), corners.max(axis=0) - MARGIN, atol=1e-9)
    sheet = corners * (1.0, 1.0, 0.05)
    np.testing.assert_allclose(np.sort(eroded(sheet, MARGIN), axis=0), np.sort(sheet, axis=0))
