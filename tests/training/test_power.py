"""The power is 1 for a right posterior, below it for one too narrow, above it for one too wide."""

import numpy as np
import pytest
import torch

from bayesgrasp.ratio.estimators import GlobalSuccess, ImageConfig
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.training.power import fit_power
from bayesgrasp.types import Hands


def observations(rng: np.random.Generator, scenes: int = 2000, draws: int = 200):
    """Log-ratios of a known problem: h ~ N(0, 1), i | h ~ N(h, 0.5^2), as log p(i | h) at truths and prior draws."""
    hands = rng.normal(size=scenes)
    images = hands + 0.5 * rng.normal(size=scenes)
    drawn = rng.normal(size=(scenes, draws))
    return -2 * (images - hands) ** 2, -2 * (images[:, None] - drawn) ** 2


@pytest.mark.parametrize("sharpened", [0.5, 1.0, 2.0])
def test_it_undoes_a_power(sharpened: float) -> None:
    truth, drawn = observations(np.random.default_rng(0))
    found = fit_power(sharpened * truth, np.ones(len(truth)), sharpened * drawn)
    assert found == pytest.approx(1 / sharpened, rel=0.06)


def test_truths_count_by_their_weight() -> None:
    """Half of the truths come with ratios twice as sharp; without weight they do not matter."""
    truth, drawn = observations(np.random.default_rng(1))
    factor = np.where(np.arange(len(truth)) % 2 == 0, 1.0, 2.0)
    weight = np.where(factor == 1.0, 1.0, 0.0)
    found = fit_power(factor * truth, weight, factor[:, None] * drawn)
    assert found == pytest.approx(1.0, rel=0.08)


def test_a_model_takes_the_power_of_its_card() -> None:
    some = Hands(
        torch.rand(5, 3, generator=torch.Generator()), torch.eye(3).expand(5, 3, 3), torch.zeros(5, dtype=torch.long)
    )
    with torch.random.fork_rng():
        estimator, image = GlobalSuccess(ImageConfig()).eval().requires_grad_(False), torch.full((1, 160, 256), 0.7)
    plain, tempered = (GraspModel({"success": estimator}, {"power": {"success": a}}) for a in (1.0, 0.5))
    torch.testing.assert_close(tempered.given_image(image)(some), 0.5 * plain.given_image(image)(some))
