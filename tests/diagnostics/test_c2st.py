"""The two-sample test tells different posteriors apart, and equal ones not."""

import known
import pytest
import torch
from c2st import C2STConfig, c2st

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.types import Hands


def sample(spread: float, seed: int) -> Hands:
    """1500 hands: with 500 the classifier has too little to learn from to tell even different sets well apart."""
    draws = [known.draw(spread, 10 * seed + part) for part in range(3)]
    return Hands.cat([draw[0] if spread == 1 else draw[1][:, 0] for draw in draws])


def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def test_equal_sets_cannot_be_told_apart() -> None:
    assert abs(c2st(sample(1.0, 1), sample(1.0, 2), generator()) - 0.5) < 0.05


def test_different_sets_can() -> None:
    first, second = sample(1.0, 1), sample(1.0, 2)
    moved = Hands(second.position + 0.1, second.rotation, second.grasp_type)
    assert c2st(first, moved, generator()) > 0.7
    other_type = Hands(second.position, second.rotation, torch.zeros_like(second.grasp_type))
    assert c2st(first, other_type, generator()) > 0.75


def test_the_answer_depends_on_the_generator_alone() -> None:
    first, second = sample(1.0, 1), sample(1.0, 2)
    assert c2st(first, second, generator()) == c2st(first, second, generator())


def test_too_small_sets_and_bad_configurations_are_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="ten hands"):
        c2st(sample(1.0, 1)[:9], sample(1.0, 2), generator())
    with pytest.raises(InvalidConfigurationError, match="folds"):
        C2STConfig(folds=1)
