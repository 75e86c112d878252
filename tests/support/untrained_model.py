"""A model directory with weights that were never trained: enough for everything but good grasps."""

from pathlib import Path

import torch

from bayesgrasp.ratio.checkpoint import Origin, save_model
from bayesgrasp.ratio.estimators import (
    FullConfig,
    FullSuccess,
    GlobalSuccess,
    ImageConfig,
    SuccessRatio,
    SuccessRatioConfig,
)
from bayesgrasp.ratio.layers import ConvConfig
from bayesgrasp.robot.robotiq_3f import robotiq_3f

OBJECTS = ("household_carton", "household_tea_box")


def save_untrained(directory: Path) -> Path:
    """Write success_ratio, success and full estimators for two household objects."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        estimators = {
            "success_ratio": SuccessRatio(SuccessRatioConfig(widths=(16,))),
            "success": GlobalSuccess(ImageConfig(encoder=ConvConfig((160, 256), (4, 8), 8), widths=(16,))),
            "full": FullSuccess(FullConfig(objects=len(OBJECTS), widths=(16,))),
        }
    prior = {"x": [-0.15, 0.15], "y": [-0.15, 0.15], "z": [0.12, 0.34], "kappa": 30.0}
    save_model(directory, estimators, Origin(robotiq_3f().name, prior=prior, objects=OBJECTS, success_rate=0.01))
    return directory
