"""Scenes made of boxes, seen by an ideal depth camera: enough to plan on, without the sensor model."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch

from bayesgrasp.assets.robotiq_3f import robotiq_3f
from bayesgrasp.geometry import so3
from bayesgrasp.geometry.camera import Camera, canonical_camera, look_at
from bayesgrasp.posterior.clearance import OpenHand
from bayesgrasp.posterior.planner import Planner, Posterior
from bayesgrasp.posterior.selection import Robot
from bayesgrasp.posterior.surface import SurfaceReader
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.simulators.preprocess import preprocess
from bayesgrasp.types import GraspType, Hands


@dataclass(frozen=True)
class Box:
    """A box on the table: middle (x, y), yaw, and size, metres and radians."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    size: tuple[float, float, float] = (0.05, 0.12, 0.12)


@dataclass(frozen=True)
class Path:
    """A motion that stands still."""

    transit: np.ndarray
    approach: np.ndarray
    lift: np.ndarray


def _box_depth(origin: np.ndarray, rays: np.ndarray, box: Box) -> np.ndarray:
    """Depth along rays (of depth 1) to a box, inf where they miss it: slabs."""
    cos, sin = np.cos(box.yaw), np.sin(box.yaw)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    half = np.array(box.size) / 2
    start = turn @ (origin - [box.x, box.y, half[2]])
    with np.errstate(divide="ignore"):
        first, last = ((side * half - start) / (rays @ turn.T) for side in (-1, 1))
    enter, leave = np.minimum(first, last).max(-1), np.maximum(first, last).min(-1)
    return np.where((enter < leave) & (enter > 0), enter, np.inf)


def box_depth_image(camera: Camera, boxes: tuple[Box, ...] = ()) -> np.ndarray:
    """Noise-free depth (h, w) of boxes on a table, metres; 0 where a ray meets nothing."""
    rays = camera.rays() @ camera.pose[:3, :3].T
    origin = camera.pose[:3, 3]
    with np.errstate(divide="ignore"):
        depth = np.where(rays[..., 2] < 0, -origin[2] / rays[..., 2], np.inf)
    for box in boxes:
        depth = np.minimum(depth, _box_depth(origin, rays, box))
    return np.where(np.isfinite(depth), depth, 0.0).astype(np.float32)


@pytest.fixture(scope="session")
def render():
    return box_depth_image


@pytest.fixture(scope="session")
def a_box():
    return Box


@pytest.fixture(scope="session")
def other_camera() -> Camera:
    """A camera that is not the canonical one."""
    pose = look_at(np.array([-0.1, 0.45, 0.6]), np.array([0.02, 0.0, 0.03]))
    return Camera(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5, camera_to_world=pose)


def standing_still(hand_to_world: np.ndarray, grasp_type: GraspType) -> Path:
    still = np.zeros((2, 6))
    return Path(still, still, still)


def given_image(image: torch.Tensor):
    """A rule of thumb in place of a trained ratio: fingers around the middle of what rises above the table."""
    camera = canonical_camera().resized(256, 160)
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
    reader = SurfaceReader(canonical_camera().resized(256, 160))
    robot = Robot(OpenHand(robotiq_3f()), standing_still)
    posterior = Posterior(given_image, lambda value: value.sigmoid())
    return Planner(posterior, GraspPrior(), lambda depth, camera: preprocess(depth), reader, robot)


@pytest.fixture(scope="session")
def downward() -> np.ndarray:
    """A hand that points straight down and closes along world x."""
    return so3.exp(torch.tensor([[0.0, 0.0, 0.0]])).numpy()[0] @ np.array(
        [[0, 1, 0], [0, 0, -1], [-1, 0, 0]], dtype=float
    )
