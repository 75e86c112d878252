"""A planner that needs no training."""

import numpy as np
import pytest
import torch
from fake_arm import FakeArm

from bayesgrasp.geometry.camera import network_camera
from bayesgrasp.observation.canonical_view import CanonicalView
from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.planning.observing import Observer
from bayesgrasp.planning.planner import Planner, TrainedLikelihood
from bayesgrasp.planning.selection import Robot
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.types import Hands


def given_image(image: torch.Tensor):
    """A rule of thumb in place of a trained ratio: fingers around the middle of what rises above the table."""
    camera = network_camera()
    surface = SurfaceReader(camera).read(image[0].numpy())
    low, high = (torch.from_numpy(np.percentile(surface.item_points, q, axis=0)).float() for q in (2, 98))
    middle = (low + high) / 2
    ahead = torch.tensor([0.13, 0.0, 0.0])

    def log_ratio(hands: Hands) -> torch.Tensor:
        tip = hands.position + hands.rotation @ ahead.to(hands.position)
        across = hands.rotation[..., 0, 1].square()
        return -0.5 * ((tip - middle) / 0.01).square().sum(-1) + 3 * across - 1.0

    return log_ratio


@pytest.fixture(scope="session")
def thumb_planner() -> Planner:
    """A planner that works without training, on canonical images."""
    likelihood = TrainedLikelihood(given_image, lambda value: value.sigmoid())
    observer = Observer(CanonicalView().of, SurfaceReader(network_camera()))
    return Planner(likelihood, GraspPrior(), observer, Robot(OpenHand(robotiq_3f()), FakeArm()))
