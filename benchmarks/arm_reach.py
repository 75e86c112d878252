"""Where to stand the arm: share of the prior's hands that it reaches, by position of its base.

A hand counts as reached if one branch of the inverse kinematics leads straight from the pre-grasp to the hand and up by
the lift height without collision of arm, hand and table; the hand's own contact with the table is left out, because
no base avoids it. Run: ``python benchmarks/arm_reach.py --hands 2500``.
"""

from collections.abc import Callable
from functools import partial

import mujoco
import numpy as np
import tyro
from jaxtyping import Float64

from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.robot.arm import ArmDescription, ur5
from bayesgrasp.robot.arm_model import ArmHandle, add_arm
from bayesgrasp.robot.gripper_model import add_gripper
from bayesgrasp.robot.motion import (
    MotionConfig,
    approach_pose,
    lifted_pose,
    reachable_branches,
    straight_path,
)
from bayesgrasp.robot.physics_scene import new_spec
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import generator
from bayesgrasp.types import GraspType

DISTANCES = (-0.40, -0.45, -0.50, -0.55)
HEIGHTS = (0.0, 0.05, 0.10, 0.15)


def collision_check(arm: ArmDescription) -> Callable[[Float64[np.ndarray, "6"]], bool]:
    """Whether the arm with the open hand collides at joint angles, the hand's contact with the table aside."""
    spec, gripper = new_spec(), robotiq_3f()
    add_gripper(spec, add_arm(spec, arm), gripper)
    for link in gripper.links:
        spec.add_exclude(bodyname1="world", bodyname2=link.name)
    model = spec.compile()
    data = mujoco.MjData(model)
    for name, angle in zip(gripper.joint_names, gripper.open_angles(GraspType.BASIC), strict=True):
        data.joint(name).qpos = angle

    return partial(ArmHandle(model).collides, data)


def reaches(arm: ArmDescription, hand: Float64[np.ndarray, "4 4"], collides: Callable[..., bool]) -> bool:
    """Whether one branch serves the whole motion."""
    config = MotionConfig()
    before, after = approach_pose(hand, config.standoff), lifted_pose(hand, config.lift_height)
    for branch in reachable_branches(arm, hand, config):
        approach = straight_path(arm, before, hand, branch[0], config)
        lift = None if approach is None else straight_path(arm, hand, after, approach[-1], config)
        if approach is not None and lift is not None and not any(map(collides, [*approach, *lift])):
            return True
    return False


def main(hands: int = 500, seed: int = 0) -> None:
    """Print the table of shares.

    Args:
        hands: Draws from the prior.
        seed: Of the draws.
    """
    drawn = GraspPrior().sample(hands, generator(seed))
    poses = np.tile(np.eye(4), (hands, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = drawn.rotation.numpy(), drawn.position.numpy()
    print("base height m" + "".join(f"{f'x = {x:.2f} m':>14}" for x in DISTANCES))
    for z in HEIGHTS:
        arms = [ur5((x, 0.0, z)) for x in DISTANCES]
        checks = map(collision_check, arms)
        shares = [np.mean([reaches(a, p, c) for p in poses]) for a, c in zip(arms, checks, strict=True)]
        print(f"{z:13.2f}" + "".join(f"{share:14.1%}" for share in shares), flush=True)


if __name__ == "__main__":
    tyro.cli(main)
