"""The rows of the table, on ratios whose optimum is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.scenes import SceneMaker
from bayesgrasp.evaluation.strategies import LADDER, SearchConfig, missing, model_strategies
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.ratio.estimators import ObjectState
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.types import Hands

PRIOR = GraspPrior()
FIXED = torch.tensor([0.05, -0.04, 0.2])
OUTSIDE = torch.tensor([0.0, 0.0, 0.5])
SEARCH = SearchConfig(num_draws=200)


def bowl(hands: Hands, middle: Tensor) -> Tensor:
    return -((hands.position - middle) / 0.02).square().sum(-1)


class Metric(nn.Module):
    def forward(self, success: Tensor, hands: Hands) -> Tensor:
        return bowl(hands, FIXED)


class Success(nn.Module):
    """Peaks outside the prior's box."""

    def encode(self, images: Tensor) -> Tensor:
        return images.mean((1, 2, 3))

    def forward(self, context: Tensor, hands: Hands) -> Tensor:
        return bowl(hands, OUTSIDE) / 100


class Full(nn.Module):
    """Peaks above the object."""

    def forward(self, state: ObjectState, hands: Hands) -> Tensor:
        above = torch.cat([state.pose[:, :2], torch.full_like(state.pose[:, :1], 0.25)], -1)
        return bowl(hands, above[:, None])


@pytest.fixture(scope="module")
def model() -> GraspModel:
    estimators = {"success_ratio": Metric(), "success": Success(), "full": Full()}
    return GraspModel(estimators, {"objects": ["household_carton"]})


def choose(model: GraspModel, name: str, scenes: SceneMaker, seed: int = 0) -> Hands:
    hands = model_strategies(model, PRIOR, SEARCH)[name](scenes.make(0), np.random.default_rng(seed))
    assert hands is not None
    assert hands.shape == (1,)
    return hands


def test_every_row_of_the_table_is_there(model: GraspModel) -> None:
    assert tuple(model_strategies(model, PRIOR, SEARCH)) == LADDER


@pytest.mark.parametrize("name", ["mle_success_ratio", "map_success_ratio"])
def test_metric_strategies_find_the_peak_of_their_ratio(model: GraspModel, scenes: SceneMaker, name: str) -> None:
    torch.testing.assert_close(choose(model, name, scenes).position[0], FIXED, atol=2e-3, rtol=0)


@pytest.mark.parametrize("name", ["mle_full", "map_full"])
def test_full_observation_knows_where_the_object_is(model: GraspModel, scenes: SceneMaker, name: str) -> None:
    x, y, _ = scenes.make(0).pose
    torch.testing.assert_close(choose(model, name, scenes).position[0], torch.tensor([x, y, 0.25]), atol=2e-3, rtol=0)


@pytest.mark.parametrize("name", ["mle_image", "map_image"])
def test_a_peak_outside_the_prior_is_not_followed(model: GraspModel, scenes: SceneMaker, name: str) -> None:
    hands = choose(model, name, scenes)
    assert PRIOR.in_support(hands).all()
    assert hands.position[0, 2] > 0.33


def test_only_the_map_minds_the_prior_of_rotations(model: GraspModel, scenes: SceneMaker) -> None:
    """The ratio is flat in the rotation: the MAP goes to a mode, the MLE stays where it started."""
    mode = choose(model, "prior_argmax", scenes)
    best = PRIOR.log_prob(mode).item()
    assert best >= PRIOR.log_prob(PRIOR.sample(2000, np.random.default_rng(1))).max().item()
    assert PRIOR.log_prob(choose(model, "map_success_ratio", scenes)).item() == pytest.approx(best, abs=0.05)
    assert PRIOR.log_prob(choose(model, "mle_success_ratio", scenes)).item() < best - 0.5


def test_missing_estimators_are_named() -> None:
    assert missing("map_full", ("success_ratio", "success")) == "the model has no full-observation estimator"
    assert missing("mle_success_ratio", ("success",)) is not None
    assert missing("map_image", ("success_ratio",)) is not None
    assert missing("map_image", ("success_ratio", "image")) is None
    assert missing("plan", ("success",)) is None
    assert missing("top_down", ()) is None


def test_full_observation_of_another_object_is_refused(model: GraspModel, scenes: SceneMaker) -> None:
    strategy = model_strategies(model, PRIOR, SEARCH)["map_full"]
    with pytest.raises(InvalidConfigurationError, match="household_tea_box"):
        strategy(scenes.make(1), np.random.default_rng(0))


def test_search_needs_draws() -> None:
    with pytest.raises(InvalidConfigurationError, match="num_draws"):
        replace(SEARCH, num_draws=0)
