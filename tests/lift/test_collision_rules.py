"""The rules of collision are those of MuJoCo."""

from itertools import combinations

import mujoco
import numpy as np

from bayesgrasp.lift.bullet.collision_rules import CollisionRules
from bayesgrasp.robot.arm import ur5
from bayesgrasp.robot.arm_model import add_arm, joint_name
from bayesgrasp.robot.gripper_model import add_gripper
from bayesgrasp.robot.physics_scene import new_spec
from bayesgrasp.robot.robotiq_3f import robotiq_3f


def test_bodies_collide_as_in_the_model() -> None:
    """All shapes of arm and hand around one point: every pair that may collide is a contact."""
    spec = new_spec()
    add_gripper(spec, add_arm(spec, ur5()), robotiq_3f())
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE  # its boxes are those of the shapes' true places
    model = spec.compile()
    model.body_pos[:], model.body_ipos[:], model.geom_pos[:] = 0.0, 0.0, 0.0
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    rules = CollisionRules(model)
    touching = {tuple(sorted(pair)) for pair in model.geom_bodyid[data.contact.geom].tolist()}
    bodies = np.unique(model.geom_bodyid).tolist()
    assert {pair for pair in combinations(bodies, 2) if rules.allow(*pair)} == touching
    assert not rules.allow(model.body("arm_base").id, model.body(joint_name(0)).id)
    assert rules.allow(0, model.body(joint_name(3)).id)
