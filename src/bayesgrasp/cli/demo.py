"""``bayesgrasp demo``: one object from its depth image to the lift, in words and in one picture."""

from __future__ import annotations

import math
from pathlib import Path

from bayesgrasp.cli.plan import describe
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.demonstration import Demonstration, demonstrate
from bayesgrasp.evaluation.scenes import Situation
from bayesgrasp.files import check_target, write_json
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.viewer.story import draw_story
from bayesgrasp.workflows.load import load_planner

VERDICTS = {
    "SUCCESS": "success. The hand closed, lifted the object by 15 cm and held it.",
    "DROPPED": "failure. The hand touched the object but did not hold it.",
    "NO_CONTACT": "failure. The hand closed on nothing.",
    "COLLISION": "failure. The open hand would hit the object or the table.",
    "UNREACHABLE": "failure. The arm finds no way there.",
    "DIVERGED": "failure. The physics engine gave up.",
}


def demo(
    object: str = "household_tea_box",
    seed: int = 0,
    out: Path = Path("demo.png"),
    model: Path | None = None,
    ycb_dir: Path | None = None,
    json: Path | None = None,
) -> None:
    """Plan a grasp for a simulated object from its depth image, and try it.

    Puts the object at a random pose, takes its picture with a simulated Kinect, plans, runs the lift test of the best
    grasp, says what happened, and draws it all.

    Args:
        object: An object's id; see `bayesgrasp objects list`.
        seed: Of the scene, the sensor's noise and the plan.
        out: Where the picture goes (.png).
        model: Directory of a trained model; by default the one that comes with the package.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        json: Write scene, plan and outcome to this file.
    """
    _check(out)
    if json is not None:
        check_target(json)
    planner = load_planner(model)
    shown = demonstrate(planner, load_objects([object], ycb_dir)[0], seed)
    draw_story(out, planner, shown)
    print_demonstration(shown, out)
    if json is not None:
        write_json(json, shown.to_dict())


def print_demonstration(shown: Demonstration, picture: Path) -> None:
    """The scene, the plan and its outcome in words."""
    print(_scene(shown.situation))
    print(describe(shown.plan))
    if shown.outcome is not None:
        print(f"Lift test of the first grasp: {VERDICTS[shown.outcome.name]}")
    lift = ", the lift" if shown.attempt is not None else ""
    print(f"wrote {picture}: the image and the hand, the posterior{lift}")


def _scene(situation: Situation) -> str:
    asset, scale = situation.asset, float(situation.scene.scale[0])
    x, y, yaw = situation.pose
    length, width, height = (100 * scale * float(side) for side in asset.extents)
    friction, missing = float(situation.nuisances.lateral_friction[0]), float((situation.depth == 0).mean())
    return (
        f"Scene: {asset.id} ({length:.0f} x {width:.0f} x {height:.0f} cm) at ({x:+.3f}, {y:+.3f}) m, "
        f"turned by {math.degrees(yaw):+.0f} degrees; friction {friction:.2f}.\n"
        f"Image: one depth image of 640 x 480 pixels by a simulated Kinect, {100 * missing:.0f} % without a return. "
        "The planner sees nothing else."
    )


def _check(out: Path) -> None:
    """Refuse before the work, not after it."""
    if out.suffix != ".png":
        raise InvalidConfigurationError(f"cannot write {out}: give a .png file")
    check_target(out)
