"""Marginals of laws that are known."""

import math

import numpy as np
import pytest
import torch

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.posterior.marginals import marginals_of
from bayesgrasp.posterior.potential import support
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import GraspType, Hands

PRIOR = GraspPrior(rotation="uniform", types=(0, 2))
BOX = support(PRIOR)


@pytest.fixture(scope="module")
def hands() -> Hands:
    return PRIOR.sample(100_000, generator(70, Stream.ATTEMPT))


def test_of_the_prior_they_are_flat(hands) -> None:
    found = marginals_of(hands, BOX, bins=8)
    np.testing.assert_allclose(found.grasp_type, [0.5, 0.0, 0.5], atol=0.01)
    for histogram, (low, high) in zip((found.x, found.y, found.z), (PRIOR.x, PRIOR.y, PRIOR.z), strict=True):
        np.testing.assert_allclose(histogram.density, 1 / (high - low), rtol=0.05)
        np.testing.assert_allclose((histogram.edges[0], histogram.edges[-1]), (low, high))
    assert found.approach.density.shape == (8, 16)
    np.testing.assert_allclose(found.approach.density, 1 / (4 * math.pi), rtol=0.15)


def test_each_integrates_to_one(hands) -> None:
    found = marginals_of(hands[:137], BOX, bins=11)
    assert found.grasp_type.sum() == pytest.approx(1.0)
    for histogram in (found.x, found.y, found.z):
        assert (histogram.density * np.diff(histogram.edges)).sum() == pytest.approx(1.0)
    areas = np.diff(found.approach.height)[:, None] * np.diff(found.approach.azimuth)
    assert areas.sum() == pytest.approx(4 * math.pi)
    assert (found.approach.density * areas).sum() == pytest.approx(1.0)


def test_a_direction_is_in_its_cell() -> None:
    rotation = torch.eye(3)[None].clone()
    rotation[0, :, 0] = torch.tensor([0.0, 0.6, -0.8])  # a quarter turn about z, far down
    found = marginals_of(Hands(torch.tensor([[0.0, 0.0, 0.2]]), rotation, torch.tensor([1])), BOX, bins=4)
    (band,), (sector,) = np.nonzero(found.approach.density)
    assert found.approach.height[band] <= -0.8 <= found.approach.height[band + 1]
    assert found.approach.azimuth[sector] <= math.pi / 2 <= found.approach.azimuth[sector + 1]
    assert found.grasp_type[GraspType.WIDE] == 1.0


def test_plain_data_names_the_types(hands) -> None:
    content = marginals_of(hands[:10], BOX, bins=3).to_dict()
    assert set(content["grasp_type"]) == {"basic", "wide", "pinch"}
    assert len(content["x"]["edges"]) == 4
    assert np.shape(content["approach"]["density"]) == (3, 6)


def test_nothing_to_count_is_refused(hands) -> None:
    with pytest.raises(InvalidConfigurationError, match="draw"):
        marginals_of(hands[:0], BOX)
    with pytest.raises(InvalidConfigurationError, match="cell"):
        marginals_of(hands, BOX, bins=0)
