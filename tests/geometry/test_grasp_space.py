"""The manifold of hand poses: gradients along geodesics, transport, and distances with types."""

import math

import numpy as np
import pytest
import torch
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.geometry.grasp_space import PAPER_LENGTH_SCALE, GraspSpace
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


def cost(h: Hands) -> Tensor:
    """A smooth function of all twelve numbers."""
    weights = torch.linspace(-1.0, 2.0, 9, dtype=h.rotation.dtype).reshape(3, 3)
    linear = (weights * h.rotation).sum((-2, -1))
    return (3 * h.position).sin().sum(-1) * (1 + linear) + linear.square() + (h.rotation**4).sum((-2, -1))


def gradient(h: Hands, space: GraspSpace = SPACE) -> Tensor:
    position, rotation = h.position.clone().requires_grad_(), h.rotation.clone().requires_grad_()
    by_x, by_r = torch.autograd.grad(cost(Hands(position, rotation, h.grasp_type)).sum(), [position, rotation])
    return space.euclidean_to_riemannian_gradient(h.rotation, by_x, by_r)


def near_pi(n: int) -> Hands:
    """Hands whose rotation is within 1e-7 of a half turn, and exactly on it."""
    base = hands(n, seed=7)
    axes = so3.log(base.rotation)
    axes = axes / axes.norm(dim=-1, keepdim=True)
    angle = math.pi - torch.tensor([0.0, 1e-7]).double().repeat(n)[:n, None]
    return Hands(base.position, so3.exp(angle * axes), base.grasp_type)


@pytest.mark.parametrize("h", [hands(20), near_pi(20)], ids=["random", "near pi"])
@pytest.mark.parametrize("space", [SPACE, GraspSpace(length_scale=PAPER_LENGTH_SCALE)], ids=["default", "paper"])
def test_gradient_is_the_slope_along_geodesics(h: Hands, space: GraspSpace) -> None:
    direction, step = tangents(20), 1e-5
    slope = (cost(space.retract(h, step * direction)) - cost(space.retract(h, -step * direction))) / (2 * step)
    torch.testing.assert_close(space.inner(gradient(h, space), direction), slope, rtol=1e-7, atol=1e-7)


def test_gradient_is_the_papers_projection() -> None:
    h = hands(20)
    by_r = torch.from_numpy(np.random.default_rng(3).standard_normal((20, 3, 3)))
    projected = h.rotation @ so3.skew(h.rotation.mT @ by_r)
    found = SPACE.euclidean_to_riemannian_gradient(h.rotation, torch.zeros_like(h.position), by_r)
    # Half the matrix inner product makes the gradient twice the projection.
    torch.testing.assert_close(h.rotation @ so3.hat(found[:, 3:]), 2 * projected)


def test_paper_metric_is_proportional_to_the_product_of_euclidean_metrics() -> None:
    h, space = hands(20), GraspSpace(length_scale=PAPER_LENGTH_SCALE)
    u, v = tangents(20, seed=1), tangents(20, seed=2)
    as_matrices = [h.rotation @ so3.hat(t[:, 3:]) for t in (u, v)]
    euclidean = (u[:, :3] * v[:, :3]).sum(-1) + (as_matrices[0] * as_matrices[1]).sum((-2, -1))
    torch.testing.assert_close(2 * space.inner(u, v), euclidean)


def test_gradient_is_independent_of_a_radial_part() -> None:
    """A symmetric part of R^T df/dR points off the manifold and must not count."""
    h = hands(20)
    symmetric = torch.eye(3, dtype=torch.float64) * 5
    found = SPACE.euclidean_to_riemannian_gradient(h.rotation, torch.zeros_like(h.position), h.rotation @ symmetric)
    torch.testing.assert_close(found, torch.zeros_like(found), atol=1e-12, rtol=0)


def test_retraction_follows_the_geodesic_to_every_order() -> None:
    h, t = hands(20), 0.4 * tangents(20)
    length = SPACE.norm(t)
    torch.testing.assert_close(SPACE.distance(h, SPACE.retract(h, t)), length)
    half_way = SPACE.retract(SPACE.retract(h, 0.5 * t), 0.5 * t)
    torch.testing.assert_close(half_way.rotation, SPACE.retract(h, t).rotation)
    torch.testing.assert_close(SPACE.log(h, SPACE.retract(h, t)), t)
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


def test_transport_is_an_isometry_that_carries_the_velocity_along() -> None:
    u, v, along = tangents(20, seed=1), tangents(20, seed=2), tangents(20, seed=3)
    moved = SPACE.transport(u, along)
    torch.testing.assert_close(SPACE.inner(moved, SPACE.transport(v, along)), SPACE.inner(u, v))
    torch.testing.assert_close(SPACE.transport(along, along), along)
    torch.testing.assert_close(SPACE.transport(moved, -along), u)


def test_transport_is_torsion_free() -> None:
    """A small geodesic parallelogram closes to third order; without the turn by half it would to second only."""
    h, u, v = hands(20), tangents(20, seed=1), tangents(20, seed=2)
    gaps = []
    for scale in (1e-1, 1e-2):
        a, b = scale * u, scale * v
        first = SPACE.retract(SPACE.retract(h, a), SPACE.transport(b, a))
        second = SPACE.retract(SPACE.retract(h, b), SPACE.transport(a, b))
        gaps.append(SPACE.distance(first, second).max())
    assert gaps[1] < gaps[0] / 500


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
    assert gradient(h).shape == (*batch, 6)
    assert SPACE.retract(h, t).shape == torch.Size(batch)
    assert SPACE.transport(t, t).shape == (*batch, 6)
    assert SPACE.distance(h, h).shape == SPACE.norm(t).shape == torch.Size(batch)


@pytest.mark.parametrize("bad", [{"length_scale": 0.0}, {"length_scale": math.nan}, {"type_distance": -1.0}])
def test_bad_metrics_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(InvalidConfigurationError, match=next(iter(bad))):
        GraspSpace(**bad)
