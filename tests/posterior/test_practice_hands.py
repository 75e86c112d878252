"""Hands to practise: as many as asked for, inside the prior's support, some at the top and some beside it."""

import pytest
import torch

from bayesgrasp.posterior.practice_hands import blind_hands, practice_hands
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.power_spherical import downward_modes
from bayesgrasp.seeding import generator
from bayesgrasp.types import Hands

CENTER = torch.tensor([0.03, -0.02, 0.2])


def log_ratio(hands: Hands) -> torch.Tensor:
    return -0.5 * ((hands.position - CENTER) / 0.03).square().sum(-1)


@pytest.mark.parametrize("count", [3, 10, 24])
def test_count_and_support(count: int) -> None:
    prior = GraspPrior()
    hands = practice_hands(log_ratio, prior, count, generator(1, count))
    assert hands.shape == (count,)
    assert bool(prior.in_support(hands).all())


def test_a_third_is_at_the_top_and_a_third_beside_it() -> None:
    hands = practice_hands(log_ratio, GraspPrior(), 90, generator(2, 0), num_draws=20_000)
    drawn, top, beside = log_ratio(hands[:42]), log_ratio(hands[42:66]), log_ratio(hands[66:])
    assert top[:6].min() > -0.05
    assert drawn.mean() < beside[:12].mean() < top[:12].mean()
    assert drawn.mean() == pytest.approx(-1.5, abs=0.6), "draws from the posterior: three squared standard normals"


def test_a_type_that_the_model_does_not_believe_in_is_tried_all_the_same() -> None:
    def one_type(hands: Hands) -> torch.Tensor:
        return log_ratio(hands) - 8.0 * (hands.grasp_type != 0)

    hands = practice_hands(one_type, GraspPrior(), 12, generator(2, 1))
    assert bool((hands.grasp_type[:4] == 0).all())
    assert sorted(hands.grasp_type[4:7].tolist()) == [0, 1, 2]


def test_the_same_stream_gives_the_same_hands() -> None:
    first, second = (practice_hands(log_ratio, GraspPrior(), 6, generator(3, 0)) for _ in range(2))
    torch.testing.assert_close(first.position, second.position, rtol=0, atol=0)


@pytest.mark.parametrize("count", [3, 10, 24])
def test_hands_for_any_scene_are_as_many_as_asked_for_and_inside(count: int) -> None:
    prior = GraspPrior()
    hands = blind_hands(log_ratio, prior, count, generator(4, count), num_draws=2000)
    assert hands.shape == (count,)
    assert bool(prior.in_support(hands).all())


def test_both_maxima_and_their_surroundings_are_practised() -> None:
    """The likelihood has its maximum at any rotation, the posterior only at a downward mode."""
    prior = GraspPrior()
    hands = blind_hands(log_ratio, prior, 90, generator(5), num_draws=5000)
    drawn, posterior, likelihood = (hands[rows] for rows in torch.arange(90).split(30))
    best = GraspPrior().log_prob_rotation(downward_modes()).max()
    for part in (posterior, likelihood):
        at, around = log_ratio(part[::2]), log_ratio(part[1::2])
        assert at.min() > -0.02
        assert around.mean() == pytest.approx(-0.375, abs=0.25), "a shift of half the width along each axis"
        assert at.mean() > around.mean() > log_ratio(drawn).mean()
    assert (best - prior.log_prob_rotation(posterior.rotation[::2])).max() < 0.05
    assert (best - prior.log_prob_rotation(likelihood.rotation[::2])).mean() > 0.5
