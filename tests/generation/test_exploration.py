"""Hands from above: over the object, inside the prior's box, fingertips clear of the table, every type."""

import numpy as np
import pytest
import torch

from bayesgrasp.generation.exploration import OVER_TABLE, Explorer
from bayesgrasp.geometry.camera import network_camera
from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import generator
from bayesgrasp.types import GraspType


@pytest.fixture(scope="module")
def explorer() -> Explorer:
    return Explorer(SurfaceReader(network_camera()), OpenHand(robotiq_3f()), GraspPrior())


@pytest.fixture(scope="module")
def image() -> np.ndarray:
    """A cube of 5 cm at (0.05, -0.04), drawn by hand into the image of a bare table."""
    camera = network_camera()
    rays = camera.rays() @ camera.pose[:3, :3].T
    origin, nearest = camera.pose[:3, 3], np.full(rays.shape[:2], np.inf)
    low, high = np.array([0.025, -0.065, 0.0]), np.array([0.075, -0.015, 0.05])
    near, far = np.sort(np.stack([(low - origin) / rays, (high - origin) / rays]), axis=0)
    enter, leave = near.max(-1), far.min(-1)
    nearest = np.where((enter < leave) & (enter > 0), enter, -origin[2] / rays[..., 2])
    return np.where(nearest < 1.0, nearest, 0.0).astype(np.float32)


def test_hands_are_over_the_object_and_clear_of_the_table(explorer: Explorer, image: np.ndarray) -> None:
    hands = explorer.propose(image, 200, generator(1))
    assert hands.shape == (200,)
    assert bool(explorer.prior.in_support(hands).all())
    middle = hands.position[:, :2].mean(0)
    torch.testing.assert_close(middle, torch.tensor([0.05, -0.04]), atol=0.008, rtol=0)
    assert set(hands.grasp_type.tolist()) == {0, 1, 2}
    assert float(hands.rotation[:, 2, 0].max()) < -0.6, "the approach axis points down"
    pose = np.eye(4)
    lowest = []
    for position, rotation, grasp_type in zip(hands.position, hands.rotation, hands.grasp_type, strict=True):
        pose[:3, :3], pose[:3, 3] = rotation, position
        lowest.append(explorer.hand.lowest(pose, GraspType(int(grasp_type))))
    clear = np.array(lowest)
    assert clear.min() > 0
    assert 0.5 < np.mean(clear < OVER_TABLE[1]) < 0.95, "most of them reach for the table"


def test_a_bare_table_gives_hands_of_the_prior(explorer: Explorer) -> None:
    bare = np.zeros((160, 256), np.float32)
    explored, drawn = explorer.propose(bare, 5, generator(2)), GraspPrior().sample(5, generator(2))
    torch.testing.assert_close(explored.position, drawn.position, rtol=0, atol=0)


def test_the_same_stream_gives_the_same_hands(explorer: Explorer, image: np.ndarray) -> None:
    first, second = (explorer.propose(image, 6, generator(3)) for _ in range(2))
    torch.testing.assert_close(first.rotation, second.rotation, rtol=0, atol=0)
