"""Power-spherical densities: integrals, moments, gradients derived twice, and float32 where the density vanishes."""

import math

import numpy as np
import pytest
import torch
from scipy import stats
from scipy.special import gammaln
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.geometry.quadrature import rotation_quadrature
from bayesgrasp.prior.power_spherical import (
    FLOOR,
    LOG_UNIFORM_ROTATION,
    PowerSpherical,
    RotationMixture,
    downward_modes,
    log_even_power,
    log_normalizer,
)

KAPPAS = [0.5, 3.0, 30.0, 200.0]
MIXTURE = RotationMixture(downward_modes(), 30.0)


def unit(*values: float) -> np.ndarray:
    vector = np.array(values)
    return vector / np.linalg.norm(vector)


def density_along(kappa: float, dimension: int, nodes: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Cosines mu . q and the probability that each stands for, by quadrature of `log_prob` over the sphere."""
    # With cosine = cos(a), the surface element is (area of the sphere one dimension lower) sin(a)^(d - 2) da.
    x, weights = np.polynomial.legendre.leggauss(nodes)
    angle, weights = (x + 1) * math.pi / 2, weights * math.pi / 2
    area = 2 * math.pi ** ((dimension - 1) / 2) / math.exp(gammaln((dimension - 1) / 2))
    q = np.zeros((nodes, dimension))
    q[:, 0], q[:, 1] = np.cos(angle), np.sin(angle)
    log_prob = PowerSpherical(np.eye(dimension)[0], kappa).log_prob(torch.from_numpy(q)).numpy()
    return np.cos(angle), weights * area * np.sin(angle) ** (dimension - 2) * np.exp(log_prob)


@pytest.mark.parametrize("kappa", KAPPAS)
@pytest.mark.parametrize("dimension", [2, 3, 4, 7])
def test_density_integrates_to_one_over_the_sphere(kappa: float, dimension: int) -> None:
    _, probability = density_along(kappa, dimension)
    # Only the smooth floor near the antipode adds mass, and only where the density hardly falls.
    assert abs(probability.sum() - 1) < (1e-3 if kappa < 1 else 1e-6)


@pytest.mark.parametrize("kappa", [3.0, 30.0])
def test_samples_have_the_moments_of_the_density(kappa: float) -> None:
    mean = unit(0.3, -1.0, 2.0, 0.5)
    draws = PowerSpherical(mean, kappa).sample(40_000, np.random.default_rng(0))
    cosine, probability = density_along(kappa, 4)
    np.testing.assert_allclose(np.linalg.norm(draws, axis=-1), 1.0, atol=1e-12)
    first, second = (probability * cosine).sum(), (probability * cosine**2).sum()
    # E q = E[t] mu; E q q^T = E[t^2] mu mu^T + (1 - E[t^2]) / (d - 1) (I - mu mu^T).
    np.testing.assert_allclose(draws.mean(0), first * mean, atol=0.01)
    along = np.outer(mean, mean)
    np.testing.assert_allclose(
        draws.T @ draws / len(draws), second * along + (1 - second) / 3 * (np.eye(4) - along), atol=0.01
    )


@pytest.mark.parametrize("dimension", [2, 3, 4])
def test_samples_follow_the_density(dimension: int) -> None:
    rng = np.random.default_rng(1)
    mean = unit(*rng.standard_normal(dimension))
    draws = PowerSpherical(mean, 8.0).sample(5000, rng) @ mean
    cosine, probability = density_along(8.0, dimension)
    edges = np.quantile(draws, np.linspace(0, 1, 11))[1:-1]
    expected = np.histogram(cosine, [-1, *edges, 1], weights=probability)[0] * len(draws)
    found = np.histogram(draws, [-1, *edges, 1])[0]
    # The expected counts come from a quadrature with 400 nodes, some of which sit on an edge: hence 5 %.
    np.testing.assert_allclose(found, expected, rtol=0.2)
    cumulative = np.interp(np.sort(draws), cosine[::-1], np.cumsum(probability[::-1]))
    assert np.abs(cumulative - (np.arange(5000) + 0.5) / 5000).max() < 0.03


def test_sampling_at_the_first_axis_and_at_its_antipode() -> None:
    rng = np.random.default_rng(2)
    for mean in (np.eye(4)[0], -np.eye(4)[0], unit(1.0, 1e-9, 0.0, 0.0)):
        assert np.all(PowerSpherical(mean, 200.0).sample(100, rng) @ mean > 0.5)


def test_gradient_is_the_papers() -> None:
    """The gradient of the density, C kappa mu (1 + mu . q)^(kappa - 1)."""
    mean, kappa = unit(0.3, -1.0, 2.0, 0.5), 30.0
    q = torch.from_numpy(PowerSpherical(mean, 2.0).sample(50, np.random.default_rng(3))).requires_grad_()
    density = PowerSpherical(mean, kappa).log_prob(q).exp()
    (gradient,) = torch.autograd.grad(density.sum(), q)
    closed = math.exp(log_normalizer(kappa, 4)) * kappa * (1 + q @ torch.from_numpy(mean))[:, None] ** (kappa - 1)
    torch.testing.assert_close(gradient, closed * torch.from_numpy(mean), rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_finite_at_the_antipode(dtype: torch.dtype) -> None:
    mean = unit(0.3, -1.0, 2.0, 0.5)
    nearby = np.linspace(-1e-3, 1e-3, 21)[:, None] * unit(1.0, 0.0, 0.0, 0.0)
    q = torch.from_numpy((-mean + nearby) / np.linalg.norm(-mean + nearby, axis=-1, keepdims=True)).to(dtype)
    q = torch.cat([q, 1.0000002 * q]).requires_grad_()  # also rounded off the sphere, where 1 + mu . q < 0
    log_prob = PowerSpherical(mean, 30.0).log_prob(q)
    (gradient,) = torch.autograd.grad(log_prob.sum(), q)
    assert log_prob.isfinite().all()
    assert gradient.isfinite().all()
    assert log_prob.max() < -200
    assert gradient.abs().max() > 1.0


def test_gradient_at_the_antipode_agrees_with_finite_differences() -> None:
    mean = unit(0.3, -1.0, 2.0, 0.5)
    q = torch.from_numpy(-mean * np.array([[1.0], [0.9999], [1.0001], [0.999]])).requires_grad_()
    assert torch.autograd.gradcheck(PowerSpherical(mean, 30.0).log_prob, q, eps=1e-8, rtol=1e-4)


def test_the_floor_does_not_touch_the_density_elsewhere() -> None:
    kappa, mean = 30.0, np.eye(4)[0]
    angle = torch.linspace(0, math.pi - 0.1, 50, dtype=torch.float64)
    q = torch.stack([angle.cos(), angle.sin(), 0 * angle, 0 * angle], -1)
    u = 1 + angle.cos()
    difference = PowerSpherical(mean, kappa).log_prob(q) - log_normalizer(kappa, 4) - kappa * u.log()
    assert (difference.abs() <= kappa * (FLOOR / u).square() + 1e-12).all()


@pytest.mark.parametrize("kappa", [1.0, 2.5, 30.0, 200.0])
def test_mixture_integrates_to_one_over_rotations(kappa: float) -> None:
    matrices, weights = rotation_quadrature(40 if kappa <= 30 else 72)
    weights = 2 * math.pi**2 * weights  # the surface measure of S^3
    total = (weights * RotationMixture(downward_modes(), kappa).log_prob(matrices).exp()).sum()
    # Exact for kappa = 30, a polynomial; odd powers of |mu . q| have a kink and converge slowly.
    assert abs(float(total) - 1) < (1e-10 if kappa == 30 else 1e-3)
    uniform = (weights * math.exp(LOG_UNIFORM_ROTATION)).sum()
    assert abs(float(uniform) - 1) < 1e-12


def test_mixture_is_the_papers_formula_and_antipodally_symmetric() -> None:
    quaternions = torch.from_numpy(np.random.default_rng(4).standard_normal((500, 4)))
    quaternions = quaternions / quaternions.norm(dim=-1, keepdim=True)
    means = so3.matrix_to_quaternion(downward_modes()).numpy()
    terms = [PowerSpherical(s * m, 30.0).log_prob(quaternions).exp() / 8 for m in means for s in (1.0, -1.0)]
    found = MIXTURE.log_prob(so3.quaternion_to_matrix(quaternions))
    torch.testing.assert_close(found, torch.stack(terms).sum(0).log(), rtol=1e-7, atol=1e-7)
    torch.testing.assert_close(MIXTURE.log_prob(so3.quaternion_to_matrix(-quaternions)), found)


def test_mixture_gradient_is_the_papers_along_the_sphere() -> None:
    q = torch.from_numpy(np.random.default_rng(5).standard_normal((200, 4)))
    q = (q / q.norm(dim=-1, keepdim=True)).requires_grad_()
    (gradient,) = torch.autograd.grad(MIXTURE.log_prob(so3.quaternion_to_matrix(q)).exp().sum(), q)
    constant = math.exp(log_normalizer(30.0, 4)) * 30.0 / 8
    closed = torch.zeros_like(q)
    for mean in so3.matrix_to_quaternion(downward_modes()):
        for signed in (mean, -mean):
            closed = closed + constant * (1 + q @ signed)[:, None] ** 29 * signed
    tangential = closed - (closed * q).sum(-1, keepdim=True) * q
    torch.testing.assert_close(gradient, tangential, rtol=1e-6, atol=1e-9)


def half_turns(mode: Tensor, dtype: torch.dtype = torch.float64) -> Tensor:
    """Rotations a half turn away from a mode, where its |mu . q| is 0; with neighbours within 1e-3 rad."""
    rng = np.random.default_rng(6)
    axes = torch.from_numpy(rng.standard_normal((30, 3)))
    axes = axes / axes.norm(dim=-1, keepdim=True)
    angles = math.pi + torch.tensor([0.0, 1e-8, -1e-8, 1e-5, 1e-3]).double()
    return (mode @ so3.exp((angles[:, None, None] * axes).reshape(-1, 3))).to(dtype)


@pytest.mark.parametrize("modes", [downward_modes(), downward_modes()[:1]], ids=["four", "one"])
def test_mixture_gradient_agrees_with_finite_differences_along_geodesics(modes: Tensor) -> None:
    mixture = RotationMixture(modes, 30.0)
    everywhere = torch.cat([half_turns(modes[0]), so3.random_rotation(50, np.random.default_rng(7), torch.float64)])
    rotation = torch.cat([everywhere, modes]).requires_grad_()
    (gradient,) = torch.autograd.grad(mixture.log_prob(rotation).sum(), rotation)
    direction = torch.from_numpy(np.random.default_rng(8).standard_normal((len(rotation), 3)))
    step = 1e-5
    ahead, behind = (mixture.log_prob(rotation.detach() @ so3.exp(s * direction)) for s in (step, -step))
    slope = (gradient * (rotation.detach() @ so3.hat(direction))).sum((-2, -1))
    torch.testing.assert_close(slope, (ahead - behind) / (2 * step), rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("kappa", [1.0, 30.0, 2000.0])
def test_mixture_is_finite_in_float32_for_every_rotation(kappa: float) -> None:
    mixture = RotationMixture(downward_modes(), kappa)
    random = so3.random_rotation(2000, np.random.default_rng(9), torch.float64)
    exact = torch.cat([random, *(half_turns(m) for m in downward_modes()), downward_modes()])
    rotation = exact.float().requires_grad_()
    log_prob = mixture.log_prob(rotation)
    (gradient,) = torch.autograd.grad(log_prob.sum(), rotation)
    assert log_prob.isfinite().all()
    assert gradient.isfinite().all()
    torch.testing.assert_close(log_prob.double(), mixture.log_prob(exact), rtol=1e-5, atol=1e-5 * kappa)


def test_single_mode_is_lowest_half_a_turn_away_and_positive_there() -> None:
    mixture = RotationMixture(downward_modes()[:1], 30.0)
    lowest = mixture.log_prob(half_turns(downward_modes()[0])[:30])
    torch.testing.assert_close(
        lowest, torch.full((30,), log_normalizer(30.0, 4), dtype=torch.float64), atol=1e-9, rtol=0
    )


@pytest.mark.parametrize("kappa", [1.0, 3.0, 30.0])
def test_even_power_is_its_polynomial_and_goes_on_along_its_tangent(kappa: float) -> None:
    end = 0.0 if kappa >= 2 else -0.01  # at 1 itself, (1 - c)^kappa has a kink for kappa < 2
    squared = torch.cat([torch.logspace(-14, end, 60, dtype=torch.float64), torch.zeros(1).double()]).requires_grad_()
    polynomial = sum(math.comb(int(kappa), 2 * k) * squared**k for k in range(int(kappa) // 2 + 1))
    assert isinstance(polynomial, Tensor)
    found = log_even_power(squared, kappa)
    torch.testing.assert_close(found, polynomial.log(), rtol=0, atol=1e-10)
    (slope,) = torch.autograd.grad(found.sum(), squared)
    (expected,) = torch.autograd.grad(polynomial.log().sum(), squared)
    torch.testing.assert_close(slope, expected, rtol=1e-4, atol=1e-4)
    below = torch.tensor([-1e-6]).double().requires_grad_()
    value = log_even_power(below, kappa)
    torch.testing.assert_close(value, -1e-6 * kappa * (kappa - 1) / 2 * torch.ones(1).double(), atol=1e-9, rtol=0)


def test_modes_point_down_and_are_quarter_turns_apart() -> None:
    modes = downward_modes()
    torch.testing.assert_close(modes[:, :, 0], torch.tensor([[0.0, 0.0, -1.0]]).double().expand(4, 3))
    for mode, following in zip(modes, modes.roll(-1, 0), strict=True):
        quarter = so3.log(following @ mode.mT)
        torch.testing.assert_close(quarter, torch.tensor([0.0, 0.0, math.pi / 2]).double())


def test_mixture_samples_follow_the_density() -> None:
    """Against rejection sampling from uniform rotations with `log_prob`, by entries of the matrix."""
    rng = np.random.default_rng(10)
    candidates = so3.random_rotation(60_000, rng, torch.float64)
    log_ratio = MIXTURE.log_prob(candidates) - MIXTURE.log_prob(downward_modes()[0])
    accepted = candidates[torch.from_numpy(rng.random(60_000)) < log_ratio.exp()]
    draws = MIXTURE.sample(len(accepted), rng)
    assert len(accepted) > 3000
    for row in range(3):
        for column in range(3):
            p_value = stats.ks_2samp(draws[:, row, column].numpy(), accepted[:, row, column].numpy()).pvalue
            assert p_value > 1e-4, (row, column)


def test_mixture_samples_have_the_closed_form_mean() -> None:
    draws = MIXTURE.sample(40_000, np.random.default_rng(11))
    # trace = 4 t^2 - 1 with t = mu . q, so a mode's mean rotation is (4 E t^2 - 1) / 3 times the mode.
    a, b = 31.5, 1.5
    square = 4 * a * b / ((a + b) ** 2 * (a + b + 1)) + ((a - b) / (a + b)) ** 2
    expected = torch.zeros(3, 3, dtype=torch.float64)
    expected[2, 0] = -(4 * square - 1) / 3
    torch.testing.assert_close(draws.mean(0), expected, atol=0.015, rtol=0)


@pytest.mark.parametrize("kappa", [0.0, -1.0, math.nan, math.inf])
def test_bad_concentration_is_refused(kappa: float) -> None:
    with pytest.raises(InvalidConfigurationError, match="kappa must be a finite number > 0"):
        PowerSpherical(np.eye(4)[0], kappa)
    with pytest.raises(InvalidConfigurationError, match="kappa"):
        RotationMixture(downward_modes(), kappa)


@pytest.mark.parametrize("mean", [np.array([1.0, 1.0]), np.array([1.0]), np.array([math.nan, 0.0])])
def test_bad_mean_is_refused(mean: np.ndarray) -> None:
    with pytest.raises(InvalidConfigurationError, match="unit length"):
        PowerSpherical(mean, 1.0)
