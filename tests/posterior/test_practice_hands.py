"""Hands to practise: as many as asked for, inside the prior's support, the later ones further up."""

import pytest
import torch

from bayesgrasp.posterior.practice_hands import practice_hands
from bayesgrasp.prior.grasp import GraspPrior
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


def test_later_thirds_are_further_up() -> None:
    hands = practice_hands(log_ratio, GraspPrior(), 90, generator(2, 0))
    drawn, halfway, top = log_ratio(hands).split(30)
    assert drawn.mean() < halfway.mean() <= top.mean()
    assert top.mean() > -0.05
    assert drawn.mean() == pytest.approx(-1.5, abs=0.6), "draws from the posterior: three squared standard normals"


def test_the_same_stream_gives_the_same_hands() -> None:
    first, second = (practice_hands(log_ratio, GraspPrior(), 6, generator(3, 0)) for _ in range(2))
    torch.testing.assert_close(first.position, second.position, rtol=0, atol=0)
