"""The manifold of hand poses: geodesics, and distances with types."""

import math

import numpy as np
import pytest
import torch
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.geometry.grasp_space import GraspSpace
from bayesgrasp.types import Hands

SPACE = GraspSpace()


def hands(*batch: int, seed: int = 0, dtype: torch.dtype = torch.float64) -> Hands:
    rng = np.random.default_rng(seed)
    n = math.prod(batch)
    position = torch.from_numpy(rng.uniform(-0.15, 0.34, (n, 3))).to(dtype)
    types = torch.from_numpy(rng.integers(3, size=n))
    rotation = so3.random_rotation(n, rng, dtype)
    return Hands(position.reshape(*batch, 3), rotation.reshape(*batch, 3, 3), types.reshape(batch))


def tangents(*batch: int, seed: int = 1, dtype: torch.dtype = torch.float64) -> Tensor:
    return torch.from_numpy(np.random.default_rng(seed).standard_normal((*batch, 6))).to(dtype)


def test_paper_metric_is_proportional_to_the_product_of_euclidean_metrics() -> None:
    """With l = sqrt(2) m/rad, squared distances are half of those of R^3 and of matrices."""
    h, space = hands(20), GraspSpace(length_scale=math.sqrt(2.0))
    near = space.retract(h, 1e-3 * tangents(20))
    euclidean = sum((a - b).flatten(1).square().sum(-1) for a, b in zip(pose(h), pose(near), strict=True))
    torch.testing.assert_close(2 * space.distance(h, near).square(), euclidean, rtol=1e-5, atol=0)


def pose(h: Hands) -> tuple[Tensor, Tensor]:
    return h.position, h.rotation


def test_retraction_follows_the_geodesic_to_every_order() -> None:
    h, t = hands(20), 0.4 * tangents(20)
    length = ((t[:, :3] / SPACE.length_scale).square() + t[:, 3:].square()).sum(-1).sqrt()
    torch.testing.assert_close(SPACE.distance(h, SPACE.retract(h, t)), length)
    half_way = SPACE.retract(SPACE.retract(h, 0.5 * t), 0.5 * t)
    torch.testing.assert_close(half_way.rotation, SPACE.retract(h, t).rotation)
    there = SPACE.retract(h, t)
    way_back = torch.cat([there.position - h.position, so3.log(h.rotation.mT @ there.rotation)], -1)
    torch.testing.assert_close(way_back, t)
    torch.testing.assert_close(SPACE.retract(h, torch.zeros_like(t)).rotation, h.rotation)


def test_retraction_is_float32_safe_and_keeps_the_type() -> None:
    h = hands(20, dtype=torch.float32)
    start, t = h, 0.3 * tangents(20, dtype=torch.float32)
    for _ in range(500):
        h = SPACE.retract(h, t)
    eye = torch.eye(3).expand(20, 3, 3)
    torch.testing.assert_close(h.rotation.mT @ h.rotation, eye, atol=1e-6, rtol=0)
    assert h.rotation.dtype == torch.float32
    assert (h.grasp_type == start.grasp_type).all()


def test_distance_is_a_metric_with_types() -> None:
    a, b, c = hands(30, seed=1), hands(30, seed=2), hands(30, seed=3)
    assert (SPACE.distance(a, b) <= SPACE.distance(a, c) + SPACE.distance(c, b) + 1e-12).all()
    torch.testing.assert_close(SPACE.distance(a, b), SPACE.distance(b, a))
    other = Hands(a.position, a.rotation, (a.grasp_type + 1) % 3)
    torch.testing.assert_close(SPACE.distance(a, other), torch.full((30,), SPACE.type_distance, dtype=torch.float64))
    assert (SPACE.distance(a, a) < 1e-7).all()


def test_length_scale_trades_metres_for_radians() -> None:
    a = hands(1)
    shifted = Hands(a.position + torch.tensor([0.1, 0.0, 0.0]).double(), a.rotation, a.grasp_type)
    turned = SPACE.retract(a, torch.tensor([[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]]).double())
    torch.testing.assert_close(SPACE.distance(a, shifted), SPACE.distance(a, turned))


@pytest.mark.parametrize("batch", [(), (1,), (2, 3), (0,)])
def test_every_batch_shape(batch: tuple[int, ...]) -> None:
    h, t = hands(*batch), tangents(*batch)
    assert SPACE.retract(h, t).shape == torch.Size(batch)
    assert SPACE.distance(h, h).shape == torch.Size(batch)


@pytest.mark.parametrize("bad", [{"length_scale": 0.0}, {"length_scale": math.nan}, {"type_distance": -1.0}])
def test_bad_metrics_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(InvalidConfigurationError, match=next(iter(bad))):
        GraspSpace(**bad)
