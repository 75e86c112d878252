"""The prior of hands: its normalisation, support, null gradient in the position, and samples."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy import stats

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.types import Hands

PRIOR = GraspPrior()


def test_density_integrates_to_one() -> None:
    """By Monte Carlo over the stated measure: the box (with a margin), uniform rotations on S^3, three types."""
    rng = np.random.default_rng(0)
    n = 40_000
    position = torch.from_numpy(rng.uniform([-0.2, -0.2, 0.1], [0.2, 0.2, 0.4], (n, 3)))
    hands = Hands(position, so3.random_rotation(n, rng, torch.float64), torch.from_numpy(rng.integers(3, size=n)))
    volume = 0.4 * 0.4 * 0.3 * 2 * math.pi**2 * 3
    for prior in (PRIOR, GraspPrior(rotation="uniform")):
        density = prior.log_prob(hands).exp() * volume
        assert abs(float(density.mean()) - 1) < 4 * float(density.std()) / math.sqrt(n)
        assert float(density.std()) / math.sqrt(n) < 0.02


def test_samples_are_inside_and_follow_the_table() -> None:
    hands = PRIOR.sample(20_000, np.random.default_rng(1))
    assert hands.position.dtype == hands.rotation.dtype == torch.float32
    assert PRIOR.in_support(hands).all()
    # The float32 rounding must not leave the box when the hands are taken to float64 either.
    assert PRIOR.in_support(hands.to(dtype=torch.float64)).all()
    assert PRIOR.log_prob(hands).isfinite().all()
    for axis, (low, high) in enumerate((PRIOR.x, PRIOR.y, PRIOR.z)):
        assert stats.kstest(hands.position[:, axis].numpy(), "uniform", (low, high - low)).pvalue > 1e-4
    assert stats.chisquare(np.bincount(hands.grasp_type.numpy(), minlength=3)).pvalue > 1e-4
    correlation = np.corrcoef(np.column_stack([hands.position, hands.rotation[:, 2, 0], hands.grasp_type]).T)
    assert np.abs(correlation - np.eye(5)).max() < 0.03


def test_hands_point_down_more_than_at_random() -> None:
    rng = np.random.default_rng(2)
    down = -PRIOR.sample(2000, rng).rotation[:, 2, 0]
    uniform = -GraspPrior(rotation="uniform").sample(2000, rng).rotation[:, 2, 0]
    assert down.mean() > 0.7
    assert abs(float(uniform.mean())) < 0.06


def test_gradient_is_null_in_position_and_not_in_rotation() -> None:
    hands = PRIOR.sample(100, np.random.default_rng(3))
    position, rotation = hands.position.clone().requires_grad_(), hands.rotation.clone().requires_grad_()
    log_prob = PRIOR.log_prob(Hands(position, rotation, hands.grasp_type))
    by_x, by_r = torch.autograd.grad(log_prob.sum(), [position, rotation])
    assert (by_x == 0).all()
    assert (by_r != 0).any(-1).any(-1).all()


def test_outside_is_minus_infinity_with_null_gradient() -> None:
    hands = PRIOR.sample(4, np.random.default_rng(4))
    position = hands.position.clone()
    position[0, 0], position[1, 2], position[2, 1] = 0.16, 0.11, -0.151
    position.requires_grad_()
    outside = Hands(position, hands.rotation.clone().requires_grad_(), hands.grasp_type)
    log_prob = PRIOR.log_prob(outside)
    assert PRIOR.in_support(outside).tolist() == [False, False, False, True]
    assert log_prob.isinf().tolist() == [True, True, True, False]
    gradients = torch.autograd.grad(log_prob[:3].sum(), [outside.position, outside.rotation])
    assert all((g == 0).all() for g in gradients)


def test_a_restricted_set_of_types() -> None:
    prior = GraspPrior(types=(0, 2))
    hands = prior.sample(200, np.random.default_rng(5))
    assert set(hands.grasp_type.tolist()) == {0, 2}
    wide = replace(hands, grasp_type=torch.ones_like(hands.grasp_type))
    assert prior.log_prob(wide).isinf().all()
    torch.testing.assert_close(prior.log_prob(hands), PRIOR.log_prob(hands) + math.log(3 / 2))


@pytest.mark.parametrize("batch", [(), (1,), (2, 3), (0,)])
def test_every_batch_shape(batch: tuple[int, ...]) -> None:
    hands = PRIOR.sample(math.prod(batch), np.random.default_rng(6))
    shaped = Hands(
        hands.position.reshape(*batch, 3), hands.rotation.reshape(*batch, 3, 3), hands.grasp_type.reshape(batch)
    )
    assert PRIOR.log_prob(shaped).shape == torch.Size(batch)
    torch.testing.assert_close(PRIOR.log_prob(shaped).flatten(), PRIOR.log_prob(hands))


def test_same_generator_same_hands() -> None:
    first, second = (PRIOR.sample(10, np.random.default_rng(7)) for _ in range(2))
    assert torch.equal(first.position, second.position)
    assert torch.equal(first.rotation, second.rotation)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"kappa": 0.0}, "kappa"),
        ({"kappa": math.nan}, "kappa"),
        ({"x": (0.1, 0.1)}, "empty"),
        ({"y": (0.2, 0.1)}, "low <= high"),
        ({"z": (0.1, math.nan)}, "finite"),
        ({"types": ()}, "types"),
        ({"types": (0, 3)}, r"\[0, 1, 2\]"),
        ({"types": (1, 1)}, "distinct"),
    ],
)
def test_bad_parameters_are_refused_by_name(bad: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidConfigurationError, match=message):
        GraspPrior(**bad)  # type: ignore[arg-type]
