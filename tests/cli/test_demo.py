"""The demo tells its story in words and in one picture, whatever becomes of the grasp."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from untrained_model import save_untrained

from bayesgrasp.cli import demo as command
from bayesgrasp.cli.main import main
from bayesgrasp.geometry.camera import network_camera
from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.planning.planner import Planner, TrainedLikelihood
from bayesgrasp.types import Hands
from bayesgrasp.workflows.load import load_planner


def given_image(image: torch.Tensor):
    """A rule of thumb in place of a trained ratio: fingers around the top of what rises above the table."""
    surface = SurfaceReader(network_camera()).read(image[0].numpy())
    low, high = (torch.from_numpy(np.percentile(surface.item_points, q, axis=0)).float() for q in (2, 98))
    middle = torch.cat([(low + high)[:2] / 2, high[2:] - 0.04])

    def log_ratio(hands: Hands) -> torch.Tensor:
        tip = hands.position + hands.rotation @ torch.tensor([0.13, 0.0, 0.0])
        return -0.5 * ((tip - middle) / 0.01).square().sum(-1) - 1.0

    return log_ratio


@pytest.fixture(scope="module")
def planner(tmp_path_factory: pytest.TempPathFactory) -> Planner:
    return load_planner(save_untrained(tmp_path_factory.mktemp("demo") / "model"))


def show(monkeypatch: pytest.MonkeyPatch, planner: Planner, rule, chance: float, out: Path) -> np.ndarray:
    """Plan by a rule that knows where hands are good, each with the same chance of success."""
    thinker = replace(planner, likelihood=TrainedLikelihood(rule, lambda value: 0 * value + chance))
    monkeypatch.setattr(command, "load_planner", lambda model: thinker)
    main(["demo", "--object", "household_carton", "--seed", "2", "--out", str(out), "--json", f"{out}.json"])
    return np.asarray(Image.open(out))


def test_a_grasp_is_planned_tried_and_drawn(
    monkeypatch: pytest.MonkeyPatch, planner: Planner, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    story = show(monkeypatch, planner, given_image, 0.9, tmp_path / "story.png")
    printed = capsys.readouterr().out
    assert "household_carton" in printed
    assert "planned in" in printed
    assert "Lift test of the first grasp: success." in printed
    assert "the lift" in printed
    written = json.loads((tmp_path / "story.png.json").read_text())
    assert written["outcome"] == "success"
    assert written["situation"]["asset"] == "household_carton"
    assert story[-150:].std() > 20, "the film strip shows something"


def test_no_grasp_is_a_story_too(
    monkeypatch: pytest.MonkeyPatch, planner: Planner, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    show(monkeypatch, planner, given_image, 0.2, tmp_path / "story.png")
    printed = capsys.readouterr().out
    assert "no grasp: not likely enough" in printed
    assert "Lift test" not in printed


def test_the_picture_is_refused_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for wrong in (tmp_path / "story.gif", tmp_path / "no" / "story.png"):
        with pytest.raises(SystemExit):
            main(["demo", "--out", str(wrong)])
        assert ".png" in capsys.readouterr().err
