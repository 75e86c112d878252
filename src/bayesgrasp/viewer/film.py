"""What an attempt looked like: frames of its physics, by ray casting."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import UInt8
from PIL import Image

from bayesgrasp.files import write_through
from bayesgrasp.geometry.camera import Camera, look_at
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.types import Attempts
from bayesgrasp.viewer.raycast import contact_sheet, physics_meshes, render

_EYE = np.array([0.36, -0.36, 0.30])
_WIDTH, _HEIGHT, _FOCAL = 240, 200, 215.0


def film_attempt(
    objects: Sequence[ObjectAsset], attempt: Attempts, frames: int = 7, config: LiftTestConfig | None = None
) -> list[UInt8[np.ndarray, "h w 3"]]:
    """Frames of the first attempt, evenly spaced in time; none if it never reached physics.

    Args:
        objects: The object set of the attempt.
        attempt: Its first row is filmed.
        frames: How many.
        config: Of the lift test, with the engine that moves what is seen.
    """
    lift_test = LiftTest(objects, config)
    states: list[np.ndarray] = []
    models: list[mujoco.MjModel] = []

    def record(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        states.append(data.qpos.copy())  # the engine goes on with the same object
        models.append(model)

    lift_test.observe(attempt, record)
    if not states:
        return []
    x, y, _ = (float(v) for v in attempt.object_pose[0])
    target = np.array([x, y, 0.13])
    camera = Camera(_WIDTH, _HEIGHT, _FOCAL, _FOCAL, _WIDTH / 2, _HEIGHT / 2, look_at(target + _EYE, target))
    data = mujoco.MjData(models[0])
    pictures = []
    for index in np.linspace(0, len(states) - 1, frames).astype(int):
        data.qpos[:] = states[index]
        mujoco.mj_kinematics(models[0], data)
        pictures.append(render(physics_meshes(models[0], data), camera))
    return pictures


def film_sheet(
    objects: Sequence[ObjectAsset], attempts: Sequence[Attempts], frames: int = 7, config: LiftTestConfig | None = None
) -> UInt8[np.ndarray, "height width 3"]:
    """One row of frames per attempt that reached physics; see `film_attempt`."""
    rows = [film_attempt(objects, attempt, frames, config) for attempt in attempts]
    return contact_sheet([picture for row in rows for picture in row], frames)


def save_film(
    path: Path, objects: Sequence[ObjectAsset], attempts: Sequence[Attempts], config: LiftTestConfig | None = None
) -> None:
    """Write a .png with a row of frames per attempt, or a moving .gif of the first one."""
    if path.suffix == ".png":
        sheet = Image.fromarray(film_sheet(objects, attempts, config=config))
        write_through(path, lambda file: sheet.save(file, format="PNG"))
        return
    frames = [Image.fromarray(frame) for frame in film_attempt(objects, attempts[0], 40, config)]
    moving = {"save_all": True, "append_images": frames[1:], "duration": 60, "loop": 0}
    write_through(path, lambda file: frames[0].save(file, format="GIF", **moving))
