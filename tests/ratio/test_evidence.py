"""Projection against the camera, and the signed depth against surfaces that are known."""

import numpy as np
import pytest
import torch

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import network_camera
from bayesgrasp.ratio.evidence import HandPoints, PointsConfig, View, ViewConfig, canonical_view, sample
from bayesgrasp.types import Hands

VIEW = View(canonical_view())


def upright(position: list[float], dtype: torch.dtype = torch.float32) -> Hands:
    """One hand whose axes are the world's: its points are the configured ones, moved to `position`."""
    eye = torch.eye(3, dtype=dtype).expand(1, 1, 3, 3)
    return Hands(torch.tensor(position, dtype=dtype).reshape(1, 1, 3), eye, torch.zeros(1, 1, dtype=torch.int64))


def test_projection_is_the_camera_s() -> None:
    points = torch.rand(50, 3, generator=torch.Generator().manual_seed(0)) * 0.3 - 0.1
    pixels, depth = network_camera().project(points.double().numpy())
    grid, ours = VIEW.project(points)
    np.testing.assert_allclose(ours.numpy(), depth, atol=1e-5)
    unit = (2 * pixels + 1) / np.array([256, 160]) - 1
    np.testing.assert_allclose(grid.numpy(), unit, atol=1e-5)


def test_grid_sampling_reads_the_pixel_under_the_point() -> None:
    u = torch.arange(256.0).expand(1, 1, 160, 256)
    points = torch.tensor([[0.02, 0.03, 0.05], [-0.05, 0.0, 0.0]])
    pixels, _ = network_camera().project(points.double().numpy())
    grid, _ = VIEW.project(points)
    np.testing.assert_allclose(sample(u, grid[None, None])[0, 0, 0].numpy(), pixels[:, 0], atol=1e-3)


def test_missing_returns_become_the_table_and_its_points_have_height_zero() -> None:
    filled = VIEW.fill(torch.zeros(1, 1, 160, 256))
    height = VIEW.surface(filled)[0, 2]
    near = filled[0, 0] < 1.4
    assert near.float().mean() > 0.8
    assert height[near].abs().max() < 1e-4


def test_signed_depth_changes_sign_at_the_table() -> None:
    depth = VIEW.fill(torch.zeros(1, 1, 160, 256))
    points = HandPoints(PointsConfig(points=((0.0, 0.0, 0.0), (0.0, 0.0, -0.05))))
    for z in (0.03, 0.02):
        grid, own = points(upright([0.01, 0.02, z]))
        above, below = (own - sample(depth, grid)[:, 0])[0, 0].tolist()
        assert above < -0.8 * z
        assert below > 0.8 * (0.05 - z)


def test_points_keep_single_precision_under_autocast() -> None:
    points, hands = HandPoints(PointsConfig()), upright([0.0123, -0.0456, 0.2])
    exact = points(hands)
    with torch.autocast("cpu", torch.bfloat16):
        rounded = points(hands)
    assert torch.equal(exact[0], rounded[0])
    assert torch.equal(exact[1], rounded[1])


def test_points_turn_with_the_hand() -> None:
    points = HandPoints(PointsConfig(points=((0.1, 0.0, 0.0),)))
    quarter = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = Hands(torch.zeros(1, 1, 3), quarter[None, None], torch.zeros(1, 1, dtype=torch.int64))
    expected, _ = VIEW.project(torch.tensor([0.0, 0.1, 0.0]))
    torch.testing.assert_close(points(turned)[0][0, 0, 0], expected)


def test_invalid_configurations_are_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="point"):
        PointsConfig(points=())
    with pytest.raises(InvalidConfigurationError, match="scales"):
        PointsConfig(scales=(0.01, 0.0))
    view = canonical_view()
    with pytest.raises(InvalidConfigurationError, match="positive"):
        ViewConfig(0, 256, view.focal, view.center, view.rotation, view.translation)
