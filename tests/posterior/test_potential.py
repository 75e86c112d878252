"""The potential and its gradient, against finite differences along geodesics of the manifold."""

import math
from dataclasses import replace

import pytest
import torch

from bayesgrasp.geometry import so3
from bayesgrasp.posterior.potential import (
    Potential,
    likelihood_potential,
    posterior_potential,
    prior_potential,
    tempered_potential,
)
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.seeding import generator
from bayesgrasp.types import Hands


def smooth_ratio(hands: Hands) -> torch.Tensor:
    """Couples position, rotation and type; defined on all matrices, as a network is."""
    x, R = hands.position, hands.rotation
    turned = torch.sin(3 * (R[..., 0, 1] * R[..., 2, 2] + x @ x.new_tensor([2.0, -1.0, 5.0])))
    return (
        turned
        + (R * R.new_tensor([[0.3, -1.0, 0.2], [0.5, 0.1, 0.9], [-0.4, 0.7, 0.6]])).sum((-2, -1))
        - (30 * x.square().sum(-1) * (1 + hands.grasp_type))
    )


def hands_at(rotation: torch.Tensor, seed: int = 0) -> Hands:
    n = len(rotation)
    hands = GraspPrior().sample(n, generator(seed)).to(dtype=torch.float64)
    return Hands(
        0.5 * hands.position + torch.tensor([0.0, 0.0, 0.115], dtype=torch.float64), rotation, hands.grasp_type
    )


def rotations(kind: str, n: int = 60) -> torch.Tensor:
    rng = generator(1)
    axis = torch.from_numpy(rng.standard_normal((n, 3)))
    axis = axis / axis.norm(dim=-1, keepdim=True)
    angle = {"identity": 1e-7, "anywhere": None, "near pi": math.pi - 1e-7, "pi": math.pi}[kind]
    if angle is None:
        return so3.random_rotation(n, rng, torch.float64)
    return so3.exp(angle * axis)


@pytest.mark.parametrize("kind", ["identity", "anywhere", "near pi", "pi"])
@pytest.mark.parametrize("make", [posterior_potential, likelihood_potential, lambda _, prior: prior_potential(prior)])
def test_gradient_is_the_derivative_along_geodesics(kind, make) -> None:
    potential: Potential = make(smooth_ratio, GraspPrior())
    hands = hands_at(rotations(kind))
    _, gradient = potential.value_and_grad(hands)
    step = 1e-5
    for axis in range(6):
        tangent = torch.zeros(6, dtype=torch.float64)
        tangent[axis] = step

        def moved(sign: float, tangent: torch.Tensor = tangent) -> torch.Tensor:
            turned = hands.rotation @ so3.exp(sign * tangent[3:])
            return potential.value(Hands(hands.position + sign * tangent[:3], turned, hands.grasp_type))

        difference = (moved(1) - moved(-1)) / (2 * step)
        torch.testing.assert_close(gradient[..., axis], difference, atol=2e-6, rtol=1e-6)


def linear_ratio(by_rotation: torch.Tensor):
    """A log-ratio whose Euclidean gradient in R is the given one everywhere."""
    return lambda hands: (by_rotation * hands.rotation).sum((-2, -1))


def test_gradient_is_twice_the_papers_projection() -> None:
    """Along R exp([w]_x), and half of the product of matrices is the one of w."""
    hands, by_rotation = hands_at(rotations("anywhere")), rotations("anywhere").flip(0) + 0.5
    _, gradient = likelihood_potential(linear_ratio(by_rotation), GraspPrior()).value_and_grad(hands)
    projected = hands.rotation @ so3.skew(hands.rotation.mT @ -by_rotation)
    torch.testing.assert_close(hands.rotation @ so3.hat(gradient[:, 3:]), 2 * projected)


def test_gradient_is_independent_of_a_radial_part() -> None:
    """A symmetric part of R^T df/dR points off the manifold and must not count."""
    hands = hands_at(rotations("anywhere"))
    symmetric = hands.rotation @ (5 * torch.eye(3, dtype=torch.float64))
    _, gradient = likelihood_potential(linear_ratio(symmetric), GraspPrior()).value_and_grad(hands)
    torch.testing.assert_close(gradient, torch.zeros_like(gradient), atol=1e-12, rtol=0)


def test_value_with_and_without_gradient_agree_for_any_chunk_and_batch_shape() -> None:
    potential = posterior_potential(smooth_ratio, GraspPrior())
    hands = GraspPrior().sample(60, generator(3))
    square = Hands(hands.position.view(6, 10, 3), hands.rotation.view(6, 10, 3, 3), hands.grasp_type.view(6, 10))
    value, gradient = potential.value_and_grad(square)
    assert gradient.shape == (6, 10, 6)
    torch.testing.assert_close(potential.value(square), value)
    torch.testing.assert_close(Potential(potential.terms, potential.box, chunk=7).value(hands), value.flatten())


def test_terms_add_up() -> None:
    prior = GraspPrior()
    hands = prior.sample(50, generator(4))
    both = posterior_potential(smooth_ratio, prior).value(hands)
    alone = [make.value(hands) for make in (likelihood_potential(smooth_ratio, prior), prior_potential(prior))]
    torch.testing.assert_close(both, alone[0] + alone[1])


def test_outside_the_box_the_potential_is_infinite() -> None:
    prior = GraspPrior()
    hands = prior.sample(4, generator(5))
    outside = Hands(hands.position + torch.tensor([0.4, 0.0, 0.0]), hands.rotation, hands.grasp_type)
    for potential in (posterior_potential(smooth_ratio, prior), likelihood_potential(smooth_ratio, prior)):
        assert potential.value(outside).isinf().all()
        assert potential.value_and_grad(outside)[0].isinf().all()


def test_a_constant_term_has_a_zero_gradient() -> None:
    potential = likelihood_potential(lambda hands: torch.zeros(hands.shape), GraspPrior())
    assert (potential.value_and_grad(GraspPrior().sample(3, generator(7)))[1] == 0).all()


def test_each_row_has_its_own_weight_of_the_prior() -> None:
    prior, n = GraspPrior(), 6
    hands = hands_at(rotations("anywhere", n))
    weight = torch.tensor([1.0, 0.0, 1.0, 0.0, 1.0, 0.0], dtype=torch.float64)
    mixed = tempered_potential(smooth_ratio, prior, weight)
    for make, rows in ((posterior_potential, [0, 2, 4]), (likelihood_potential, [1, 3, 5])):
        alone = make(smooth_ratio, prior)
        some = hands[torch.tensor(rows)]
        torch.testing.assert_close(mixed.value(hands)[rows], alone.value(some))
        for found in (mixed.value_and_grad(hands), mixed.of(torch.tensor(rows)).value_and_grad(some)):
            value, gradient = (part[rows] if len(part) == n else part for part in found)
            expected = alone.value_and_grad(some)
            torch.testing.assert_close(value, expected[0])
            torch.testing.assert_close(gradient, expected[1])


def test_row_weights_survive_evaluation_in_chunks() -> None:
    weight = torch.arange(5, dtype=torch.float64)
    hands = hands_at(rotations("anywhere", 5))
    whole = tempered_potential(smooth_ratio, GraspPrior(), weight)
    torch.testing.assert_close(replace(whole, chunk=2).value(hands), whole.value(hands))
