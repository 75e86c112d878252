"""Loading a planner: a model that fits itself and not the task is refused at once, not at the first plan."""

from pathlib import Path

import pytest
import torch
from torch import nn

from bayesgrasp.errors import CheckpointError
from bayesgrasp.ratio.checkpoint import Origin, save_model
from bayesgrasp.ratio.estimators import GlobalSuccess, ImageConfig, SuccessRatio, SuccessRatioConfig
from bayesgrasp.ratio.layers import ConvConfig
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import generator
from bayesgrasp.workflows.load import load_planner


def saved(directory: Path, **estimators: nn.Module) -> Path:
    save_model(directory, estimators, Origin(robotiq_3f().name, success_rate=0.01))
    return directory


def on_images(height: int, width: int) -> GlobalSuccess:
    with torch.random.fork_rng():
        return GlobalSuccess(ImageConfig(encoder=ConvConfig((height, width), (4, 8), 8), widths=(16,)))


def test_a_model_for_other_images_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="does not take images of 256 x 160 pixels") as refused:
        load_planner(saved(tmp_path, success=on_images(80, 128)))
    assert len(str(refused.value)) < 300


def test_a_model_whose_answers_are_no_numbers_is_refused(tmp_path: Path) -> None:
    broken = on_images(160, 256)
    for number, parameter in enumerate(broken.parameters()):
        draws = torch.from_numpy(generator(number).uniform(-9e5, 9e5, parameter.shape)).float()
        parameter.data.copy_(draws)
    with pytest.raises(CheckpointError, match="does not answer with numbers"):
        load_planner(saved(tmp_path, success=broken))


def test_a_model_that_looks_at_no_image_is_refused(tmp_path: Path) -> None:
    with torch.random.fork_rng():
        alone = SuccessRatio(SuccessRatioConfig(widths=(16,)))
    with pytest.raises(CheckpointError, match="no 'image' estimator"):
        load_planner(saved(tmp_path, success_ratio=alone))
