"""Halving finds the best of fixed hands, and the shipped estimator of r(S | h) finds one as good."""

import math
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import torch

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.baselines.fixed_hands import Blindfold, Round, halve
from bayesgrasp.geometry import so3
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.posterior.ascent import AscentConfig, find_map
from bayesgrasp.posterior.potential import likelihood_potential, posterior_potential
from bayesgrasp.prior.power_spherical import downward_modes
from bayesgrasp.ratio.checkpoint import load_model
from bayesgrasp.seeding import generator
from bayesgrasp.types import Attempts, Hands, Outcome
from bayesgrasp.workflows.load import PAPER_MODEL, trained_prior

HEIGHTS, TURNS, LEANS = np.linspace(0.15, 0.31, 17), (0.0, math.pi / 2), (0.0, 0.4)
ROUNDS = (Round(4, 50), Round(8, 12), Round(24, 1))
SCENES, JUDGED = 240, 1000


def grid() -> Hands:
    """204 hands over the centre: every type, 17 heights, two turns, upright and leaning by 23 degrees."""
    position, rotation, types = [], [], []
    for grasp_type, height, turn, lean in product(range(3), HEIGHTS, TURNS, LEANS):
        turned = so3.exp(torch.tensor([0.0, 0.0, turn])).double() @ downward_modes()[0]
        leaning = so3.exp(torch.tensor([lean, 0.0, 0.0])).double() @ turned
        aside = -0.17 * leaning[:2, 0]
        position.append(torch.cat([aside, torch.tensor([height]).double()]))
        rotation.append(leaning)
        types.append(grasp_type)
    return Hands(torch.stack(position).float(), torch.stack(rotation).float(), torch.tensor(types))


def near(attempts: Attempts) -> np.ndarray:
    """A lift test that succeeds the surer the nearer the palm is to a height of 0.2 m, by the scene's friction."""
    chance = np.exp(-(((attempts.position[:, 2] - 0.2) / 0.02) ** 2))
    draw = (1e4 * attempts.lateral_friction) % 1.0
    return np.where(draw < 0.8 * chance, Outcome.SUCCESS, Outcome.DROPPED).astype(np.uint8)


def test_halving_keeps_the_best() -> None:
    left = halve(grid(), Blindfold(near, 3, seed=1), (Round(20, 60), Round(100, 12)))
    assert left.shape == (12,)
    assert (left.position[:, 2] - 0.2).abs().max() < 0.011


def test_hands_meet_the_same_scenes_and_objects_take_turns() -> None:
    blindfold = Blindfold(near, 3, seed=1)
    twice = grid()[torch.tensor([20, 20])]
    first, second = blindfold.succeed(twice, 50, 0)
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, blindfold.succeed(twice, 50, 1)[0])
    assert blindfold.scenes(7, 0)[0].object_index.tolist() == [0, 1, 2, 0, 1, 2, 0]


@pytest.mark.parametrize("rounds", [(), (Round(0, 1),), (Round(4, 0),)])
def test_halving_without_rounds_is_refused(rounds: tuple[Round, ...]) -> None:
    with pytest.raises(InvalidConfigurationError, match="rounds"):
        halve(grid(), Blindfold(near, 3, seed=1), rounds)


@pytest.mark.skipif(not (PAPER_MODEL / "card.json").exists(), reason="no trained model is shipped")
def test_the_maxima_of_the_shipped_estimator_are_as_good_as_the_best_of_a_grid(ycb_dir: Path) -> None:
    """On the objects that it was trained on, in scenes that chose neither; two standard errors are allowed."""
    objects = load_objects("train", ycb_dir)
    blindfold = Blindfold(LiftTest(objects).run, len(objects), seed=11)
    model = load_model(PAPER_MODEL)
    ratio, prior = model.given_success(), trained_prior(model.card)
    searches = likelihood_potential(ratio, prior), posterior_potential(ratio, prior)
    config = AscentConfig(starts_per_type=4)
    found = [find_map(potential, prior, generator(11), config=config).best[None] for potential in searches]
    fixed, *maxima = blindfold.succeed(Hands.cat([halve(grid(), blindfold, ROUNDS), *found]), SCENES, JUDGED)
    for maximum in maxima:
        more = maximum.astype(float) - fixed
        assert more.mean() > -2 * more.std() / math.sqrt(SCENES)
