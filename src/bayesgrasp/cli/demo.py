"""``bayesgrasp demo``: one object from its depth image to the lift, in words and in one picture."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jaxtyping import UInt8
    from numpy import ndarray
    from PIL.Image import Image as Picture

    from bayesgrasp.evaluation.scenes import Situation
    from bayesgrasp.planning.plan import Plan
    from bayesgrasp.planning.planner import Planner
    from bayesgrasp.types import Attempts, Outcome

SAMPLES = 2000
FRAMES = 7


def demo(
    object: str = "household_tea_box",
    seed: int = 0,
    out: Path = Path("demo.png"),
    model: Path | None = None,
    ycb_dir: Path | None = None,
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
    """
    from bayesgrasp.cli.plan import describe
    from bayesgrasp.evaluation.scenes import SceneMaker
    from bayesgrasp.evaluation.strategies import first_grasp
    from bayesgrasp.geometry.camera import canonical_camera
    from bayesgrasp.lift.lift_test import LiftTest
    from bayesgrasp.objects.catalogue import load_objects
    from bayesgrasp.types import Outcome
    from bayesgrasp.workflows.load import load_planner

    _check(out)
    planner = load_planner(model)
    situation = SceneMaker(load_objects([object], ycb_dir), seed).make(0)
    print(describe_scene(situation))
    plan = planner.plan(situation.depth, canonical_camera(), samples=SAMPLES, seed=seed)
    print(describe(plan))
    hands = first_grasp(plan)
    attempt = None if hands is None else situation.attempts(hands)
    outcome = None if attempt is None else Outcome(int(LiftTest((situation.asset,)).run(attempt)[0]))
    if outcome is not None:
        print(f"Lift test of the first grasp: {VERDICTS[outcome.name]}")
    draw_story(out, planner, situation, plan, attempt, outcome)
    print(f"wrote {out}: the image and the hand, the posterior" + (", the lift" if attempt is not None else ""))


VERDICTS = {
    "SUCCESS": "success. The hand closed, lifted the object by 15 cm and held it.",
    "DROPPED": "failure. The hand touched the object but did not hold it.",
    "NO_CONTACT": "failure. The hand closed on nothing.",
    "COLLISION": "failure. The open hand would hit the object or the table.",
    "UNREACHABLE": "failure. The arm finds no way there.",
    "DIVERGED": "failure. The physics engine gave up.",
}


def describe_scene(situation: Situation) -> str:
    """The scene and its image in words."""
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


def draw_story(
    path: Path,
    planner: Planner,
    situation: Situation,
    plan: Plan,
    attempt: Attempts | None = None,
    outcome: Outcome | None = None,
) -> None:
    """The plan's figure above a film strip of its lift test.

    Args:
        path: Where to, a .png file.
        planner: Whose hand is drawn.
        situation: The scene.
        plan: The plan for its image.
        attempt: The lift test of its first grasp.
        outcome: How that ended.
    """
    from PIL import Image

    from bayesgrasp.geometry.camera import canonical_camera
    from bayesgrasp.planning.figure import save_plan_figure
    from bayesgrasp.viewer.film import film_attempt

    with tempfile.TemporaryDirectory() as scratch:
        figure = Path(scratch) / "plan.png"
        save_plan_figure(figure, plan, situation.depth, canonical_camera(), planner.robot.hand)
        pictures = [Image.open(figure).convert("RGB")]
    frames = [] if attempt is None else film_attempt((situation.asset,), attempt, FRAMES)
    if frames and outcome is not None:
        caption = f"Lift test of this grasp, seen from the side: {outcome.name.lower().replace('_', ' ')}"
        pictures += [_caption(caption, pictures[0].width), _strip(frames, pictures[0].width)]
    story = Image.new("RGB", (pictures[0].width, sum(picture.height for picture in pictures)), "white")
    top = 0
    for picture in pictures:
        story.paste(picture, (0, top))
        top += picture.height
    story.save(path)


def _strip(frames: list[UInt8[ndarray, "h w 3"]], width: int) -> Picture:
    from PIL import Image

    from bayesgrasp.viewer.raycast import contact_sheet

    strip = Image.fromarray(contact_sheet(frames, len(frames)))
    return strip.resize((width, round(strip.height * width / strip.width)), Image.Resampling.LANCZOS)


def _caption(text: str, width: int) -> Picture:
    from PIL import Image, ImageDraw, ImageFont

    caption = Image.new("RGB", (width, 48), "white")
    ImageDraw.Draw(caption).text((16, 10), text, fill="black", font=ImageFont.load_default(24))
    return caption


def _check(out: Path) -> None:
    """Refuse before the work, not after it."""
    from bayesgrasp.errors import InvalidConfigurationError

    if out.suffix != ".png" or not out.resolve().parent.is_dir():
        raise InvalidConfigurationError(f"cannot write {out}: give a .png file in a directory that exists")
