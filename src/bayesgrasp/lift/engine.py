"""What a physics engine has to do for the lift test, and MuJoCo doing it.

The scene is described once: arm, hand, table and object as a compiled MuJoCo model (`objects`, `robot`). Its data
(`mujoco.MjData`) is the state that all engines share: joint angles, the object's pose, set-points of the servos,
tensions of the motors, the force on the object. An engine takes the state over, advances it by control periods, and
says whether hand and object touch; everything else of a lift test (motion, closing, criterion, pictures) reads and
writes the shared state and is the same code for every engine.
"""

from __future__ import annotations

from typing import Protocol

import mujoco

from bayesgrasp.robot.gripper_model import GripperHandle
from bayesgrasp.robot.physics_scene import ObjectHandle


class DivergedError(Exception):
    """The simulation left the region where it means anything."""


class Engine(Protocol):
    """Physics of one compiled model.

    The shared state: before ``start`` qpos and ctrl; while it runs ctrl and the force on the object (``xfrc_applied``,
    newton, at its centre of mass) go in, and qpos, qvel, actuator_force, positions of bodies and time come out.
    """

    def start(self) -> None:
        """Take over the state, at rest."""

    def advance(self, seconds: float) -> None:
        """Advance the state."""

    def touching(self) -> bool:
        """Whether hand and object were in contact in the last step."""

    def stop(self) -> None:
        """Let go of everything that ``start`` took."""


class MujocoEngine:
    """MuJoCo: the shared state is its own.

    Args:
        model: With a hand and an object.
        data: Of the model.
        hand: The hand in it.
        item: The object in it.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, hand: GripperHandle, item: ObjectHandle) -> None:
        self.model, self.data = model, data
        # A hand and an object make three, and no other pair does.
        self._kind = (1 * hand.is_geom + 2 * (model.geom_bodyid == item.body)).tolist()

    def start(self) -> None:
        """Nothing to take over."""

    def advance(self, seconds: float) -> None:
        """Whole steps of MuJoCo's own."""
        mujoco.mj_step(self.model, self.data, round(seconds / self.model.opt.timestep))

    def touching(self) -> bool:
        """Whether the shapes of hand and object overlap."""
        kind = self._kind  # plain numbers: contacts are few, and array calls cost more than they
        return any(kind[first] + kind[second] == 3 for first, second in self.data.contact.geom.tolist())

    def stop(self) -> None:
        """Nothing to let go."""
