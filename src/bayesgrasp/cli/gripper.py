"""``bayesgrasp gripper show``: which hands are described, what one is made of, and how it closes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from PIL import Image

from bayesgrasp.errors import InvalidConfigurationError, shown
from bayesgrasp.files import check_target, write_through
from bayesgrasp.lift.hand_kinematics import HandKinematics
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.robotiq_2f_85 import robotiq_2f_85
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.types import GraspType
from bayesgrasp.viewer.hand_picture import PERIOD, hand_picture

HANDS: dict[str, Callable[[], GripperDescription]] = {"robotiq-3f": robotiq_3f, "robotiq-2f-85": robotiq_2f_85}
"""Descriptions that come with the package, by name."""


def show(name: Annotated[str, tyro.conf.Positional] = "robotiq-3f", figure: Path | None = None) -> None:
    """Describe a gripper, and draw it open, half way and closed.

    Args:
        name: Which gripper: robotiq-3f or robotiq-2f-85.
        figure: Where the picture goes, .png.
    """
    if name not in HANDS:
        raise InvalidConfigurationError(f"there is no gripper {shown(name)}; known: {', '.join(HANDS)}")
    if figure is not None:
        check_target(figure)
    hand = HANDS[name]()
    kinematics = HandKinematics(hand)
    print("\n".join((*_parts(hand), *_closing(kinematics))))
    if figure is not None:
        image = Image.fromarray(hand_picture(kinematics))
        write_through(figure, lambda file: image.save(file, format="PNG", optimize=True))
        print(f"picture      {figure}")


def _parts(hand: GripperDescription) -> list[str]:
    mass = sum(link.mass for link in hand.links)
    return [
        f"gripper      {hand.name}, description {hand.identity.sha256[:8]}",
        f"links        {len(hand.links)}, {mass:.2f} kg",
        f"joints       {len(hand.joint_names)}: {', '.join(hand.joint_names)}",
        f"motors       {len(hand.motors)}: {', '.join(motor.name for motor in hand.motors)}",
        f"couplings    {len(hand.couplings)}, held joints {len(hand.holders)}",
    ]


def _closing(kinematics: HandKinematics) -> list[str]:
    """How each grasp type closes on nothing; a joint that goes far is named with where it ends."""
    lines = []
    for grasp_type in GraspType:
        path = kinematics.record_closing(grasp_type, PERIOD)
        ends = zip(kinematics.gripper.joint_names, path.angles[-1], np.ptp(path.angles, axis=0), strict=True)
        moved = [f"{name} {angle:.2f}" for name, angle, way in ends if way > 0.01]
        lines.append(f"{grasp_type.name.lower():<12} closes in {PERIOD * len(path):.2f} s: {', '.join(moved)}")
    return lines
