"""A demonstration in one picture: the plan's figure above a film strip of its lift test."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

from bayesgrasp.evaluation.demonstration import Demonstration
from bayesgrasp.files import write_through
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.planning.figure import DOTS, plan_figure
from bayesgrasp.planning.planner import Planner
from bayesgrasp.viewer.film import film_attempt
from bayesgrasp.viewer.raycast import contact_sheet

FRAMES = 7


def draw_story(path: Path, planner: Planner, shown: Demonstration) -> None:
    """The plan's figure above a film strip of its lift test, as a .png file."""
    content = io.BytesIO()
    figure = plan_figure(shown.plan, shown.situation.depth, canonical_camera(), planner.robot.hand)
    figure.savefig(content, format="png", dpi=DOTS)
    pictures = [Image.open(content).convert("RGB")]
    frames = [] if shown.attempt is None else film_attempt((shown.situation.asset,), shown.attempt, FRAMES)
    if frames and shown.outcome is not None:
        ending = shown.outcome.name.lower().replace("_", " ")
        caption = _caption(f"Lift test of this grasp, seen from the side: {ending}", pictures[0].width)
        pictures += [caption, _strip(frames, pictures[0].width)]
    story = Image.new("RGB", (pictures[0].width, sum(picture.height for picture in pictures)), "white")
    top = 0
    for picture in pictures:
        story.paste(picture, (0, top))
        top += picture.height
    write_through(path, lambda file: story.save(file, format="PNG"))


def _strip(frames: list[UInt8[np.ndarray, "h w 3"]], width: int) -> Image.Image:
    strip = Image.fromarray(contact_sheet(frames, len(frames)))
    return strip.resize((width, round(strip.height * width / strip.width)), Image.Resampling.LANCZOS)


def _caption(text: str, width: int) -> Image.Image:
    caption = Image.new("RGB", (width, 48), "white")
    ImageDraw.Draw(caption).text((16, 10), text, fill="black", font=ImageFont.load_default(24))
    return caption
