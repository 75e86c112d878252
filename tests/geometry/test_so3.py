"""Rotations by their axioms, with most points where formulas break: at the identity, 1e-7 from it, and at pi."""

import math

import numpy as np
import pytest
import torch
from torch import Tensor

from bayesgrasp.geometry import so3

TOLERANCE = 1e-8
BATCHES = [(), (1,), (5,), (2, 3), (0,)]
# Angles around every switch between a series and a closed form, and around the cut at pi.
ANGLES = [0.0, 1e-12, 1e-7, 1e-4, 0.0999, 0.1001, 0.1999, 0.2003, 1.0, 3.0, math.pi - 1e-4, math.pi - 1e-7, math.pi]


def axes(n: int, seed: int = 0) -> Tensor:
    """Unit vectors: the coordinate axes, both ways, then random ones."""
    rng = np.random.default_rng(seed)
    vectors = np.concatenate([np.eye(3), -np.eye(3), rng.standard_normal((n, 3))])
    return torch.from_numpy(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def bad_vectors() -> Tensor:
    return (torch.tensor(ANGLES, dtype=torch.float64)[:, None, None] * axes(10)).reshape(-1, 3)


def rotations(*batch: int, seed: int = 0) -> Tensor:
    rng = np.random.default_rng(seed)
    return so3.random_rotation(math.prod(batch), rng, torch.float64).reshape(*batch, 3, 3)


def close(first: Tensor, second: Tensor, tolerance: float = TOLERANCE) -> None:
    torch.testing.assert_close(first, second, rtol=0, atol=tolerance)


def identity(like: Tensor) -> Tensor:
    return torch.eye(3, dtype=like.dtype).expand_as(like)


def test_exp_is_the_matrix_exponential() -> None:
    vectors = bad_vectors()
    close(so3.exp(vectors), torch.linalg.matrix_exp(so3.hat(vectors)), 1e-13)


def test_exp_lands_on_so3() -> None:
    matrices = so3.exp(3 * bad_vectors())
    close(matrices.mT @ matrices, identity(matrices), 1e-13)
    close(torch.linalg.det(matrices), torch.ones(len(matrices), dtype=torch.float64), 1e-13)


def test_log_inverts_exp_up_to_the_cut() -> None:
    vectors = bad_vectors()
    away = vectors.norm(dim=-1) < math.pi - 1e-9
    close(so3.log(so3.exp(vectors[away])), vectors[away], 1e-9)
    # On the cut there are two logarithms; either is right.
    close(so3.exp(so3.log(so3.exp(vectors))), so3.exp(vectors), 1e-12)
    assert so3.log(so3.exp(vectors)).norm(dim=-1).max() <= math.pi + 1e-12


def test_quaternions_invert_matrices_everywhere() -> None:
    matrices = torch.cat([so3.exp(bad_vectors()), rotations(100)])
    quaternions = so3.matrix_to_quaternion(matrices)
    close(so3.quaternion_to_matrix(quaternions), matrices, 1e-12)
    close(quaternions.norm(dim=-1), torch.ones(len(matrices), dtype=torch.float64), 1e-14)
    assert (quaternions[:, 0] >= 0).all()


def test_a_quaternion_its_antipode_and_its_multiples_are_one_rotation() -> None:
    quaternions = torch.from_numpy(np.random.default_rng(1).standard_normal((50, 4)))
    close(so3.quaternion_to_matrix(-3 * quaternions), so3.quaternion_to_matrix(quaternions), 1e-14)


def test_quaternion_order_and_sense() -> None:
    quarter = torch.tensor([math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)], dtype=torch.float64)
    matrix = so3.quaternion_to_matrix(quarter)
    close(matrix @ torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64), torch.tensor([0.0, 1.0, 0.0]).double(), 1e-15)
    close(matrix, so3.exp(torch.tensor([0.0, 0.0, math.pi / 2], dtype=torch.float64)), 1e-15)


def test_hat_vee_and_skew() -> None:
    a, b = axes(7, seed=1), axes(7, seed=2)
    close((so3.hat(a) @ b[..., None]).squeeze(-1), torch.linalg.cross(a, b), 1e-15)
    close(so3.vee(so3.hat(a)), a, 0.0)
    matrix = torch.from_numpy(np.random.default_rng(0).standard_normal((4, 3, 3)))
    close(so3.skew(matrix), -so3.skew(matrix).mT, 0.0)
    close(so3.skew(matrix) + 0.5 * (matrix + matrix.mT), matrix, 1e-15)


def test_geodesic_distance_is_a_bi_invariant_metric() -> None:
    a, b, c = rotations(40, seed=1), rotations(40, seed=2), rotations(40, seed=3)
    distance = so3.geodesic_distance(a, b)
    close(distance, so3.geodesic_distance(b, a))
    close(distance, so3.geodesic_distance(c @ a, c @ b))
    close(distance, so3.geodesic_distance(a @ c, b @ c))
    assert (distance <= so3.geodesic_distance(a, c) + so3.geodesic_distance(c, b) + 1e-12).all()
    close(so3.geodesic_distance(a, a), torch.zeros(40, dtype=torch.float64))


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float64, TOLERANCE), (torch.float32, 3e-6)])
def test_geodesic_distance_is_the_angle_also_when_tiny_and_at_pi(dtype: torch.dtype, tolerance: float) -> None:
    vectors = bad_vectors()
    found = so3.geodesic_distance(torch.eye(3, dtype=dtype), so3.exp(vectors.to(dtype)))
    close(found.double(), vectors.norm(dim=-1), tolerance)


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_every_batch_shape_and_type(batch: tuple[int, ...], dtype: torch.dtype) -> None:
    vector = torch.full((*batch, 3), 0.3, dtype=dtype)
    matrix = so3.exp(vector)
    assert matrix.shape == (*batch, 3, 3)
    assert so3.log(matrix).shape == (*batch, 3)
    assert so3.matrix_to_quaternion(matrix).shape == (*batch, 4)
    assert so3.quaternion_to_matrix(so3.matrix_to_quaternion(matrix)).shape == (*batch, 3, 3)
    assert so3.geodesic_distance(matrix, torch.eye(3, dtype=dtype)).shape == batch
    assert so3.renormalize(matrix).dtype == matrix.dtype == dtype
    torch.testing.assert_close(so3.log(matrix), vector, rtol=0, atol=1e-6)


@pytest.mark.parametrize("function", [so3.exp, lambda v: so3.log(so3.exp(v)), lambda v: so3.exp(so3.log(so3.exp(v)))])
def test_gradients_agree_with_finite_differences_away_from_the_cut(function) -> None:  # type: ignore[no-untyped-def]
    vectors = bad_vectors()
    vectors = vectors[vectors.norm(dim=-1) < 3.1][::4].requires_grad_()
    assert torch.autograd.gradcheck(function, vectors, eps=1e-6, atol=1e-6)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_gradients_are_finite_everywhere(dtype: torch.dtype) -> None:
    matrices = so3.exp(bad_vectors().to(dtype)).detach().requires_grad_()
    eye = torch.eye(3, dtype=dtype)
    outputs = [so3.matrix_to_quaternion(matrices), so3.log(matrices), so3.geodesic_distance(matrices, eye)]
    for output in outputs:
        (gradient,) = torch.autograd.grad(output.sum(), matrices)
        assert gradient.isfinite().all()
        # At a distance of 0 the gradient is 0 by convention; elsewhere it must be there.
        assert gradient.abs().max() > 0.1


def test_distance_gradient_has_unit_length_along_the_group() -> None:
    vector = (axes(10) * 2.0).requires_grad_()
    distance = so3.geodesic_distance(torch.eye(3, dtype=torch.float64), so3.exp(vector))
    (gradient,) = torch.autograd.grad(distance.sum(), vector)
    close(gradient, axes(10))


def test_random_rotations_are_uniform() -> None:
    matrices = so3.random_rotation(20_000, np.random.default_rng(3), torch.float64)
    # Haar measure: E R = 0, E R_ij^2 = 1/3, and trace R has mean 0 and variance 1.
    close(matrices.mean(0), torch.zeros(3, 3, dtype=torch.float64), 0.02)
    close(matrices.square().mean(0), torch.full((3, 3), 1 / 3, dtype=torch.float64), 0.02)
    trace = matrices.diagonal(dim1=-2, dim2=-1).sum(-1)
    assert abs(float(trace.mean())) < 0.03
    assert abs(float(trace.var()) - 1) < 0.05
    assert so3.random_rotation(2, np.random.default_rng(3)).dtype == torch.float32


def test_renormalizing_squares_the_error() -> None:
    matrices = rotations(20) + 1e-4 * torch.from_numpy(np.random.default_rng(6).standard_normal((20, 3, 3)))
    renewed = so3.renormalize(matrices)
    close(renewed.mT @ renewed, identity(renewed), 1e-6)
    left, _, right = torch.linalg.svd(matrices)
    close(renewed, left @ right, 1e-6)  # the closest rotation (orthogonal Procrustes)


def test_float32_products_stay_on_so3() -> None:
    matrix, step = torch.eye(3), so3.exp(torch.tensor([0.3, -0.2, 0.5]))
    for _ in range(2000):
        matrix = so3.renormalize(matrix @ step)
    close(matrix.mT @ matrix, torch.eye(3), 1e-6)
