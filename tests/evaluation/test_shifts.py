"""Shifts change what they say and nothing else; grasps that they cannot change are executed again as they are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.journal import SceneResult
from bayesgrasp.evaluation.runner import Benchmark, run
from bayesgrasp.evaluation.scenes import SceneMaker, Situation
from bayesgrasp.evaluation.shifts import NONE, SHIFTS, Shift, find_shift
from bayesgrasp.evaluation.strategies import STRATEGIES, SearchConfig, replans
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.posterior.ascent import AscentConfig
from bayesgrasp.ratio.card import read_card
from bayesgrasp.workflows.evaluate import ModelContestants

KNOWS_NOTHING = ("prior_sample", "prior_argmax", "mle_success_ratio", "map_success_ratio")
OF_THE_IMAGE = ("mle_image", "map_image", "top_down", "plan")
OF_THE_OBJECT = ("mle_full", "map_full", "force_closure")


@pytest.fixture(scope="module")
def benchmark(objects: tuple[ObjectAsset, ...], untrained: Path) -> Benchmark:
    search = SearchConfig(50, AscentConfig(steps=2))
    strategies = ("mle_success_ratio", "map_image", "map_full", "top_down")
    return Benchmark(objects, ModelContestants(untrained).load, strategies, seed=5, search=search)


@pytest.fixture(scope="module")
def unshifted(benchmark: Benchmark) -> tuple[SceneResult, ...]:
    return run(benchmark, 2)


def situations(objects: tuple[ObjectAsset, ...], name: str) -> tuple[Situation, Situation]:
    return SceneMaker(objects, 3).make(2), SceneMaker(objects, 3, shift=SHIFTS[name]).make(2)


def timeless(result: SceneResult) -> SceneResult:
    return replace(result, trials={name: replace(trial, seconds=0.0) for name, trial in result.trials.items()})


@pytest.mark.parametrize("name", SHIFTS)
def test_all_shifts_meet_the_same_scenes(objects: tuple[ObjectAsset, ...], name: str) -> None:
    before, after = situations(objects, name)
    assert before.pose == after.pose
    assert before.asset is after.asset
    shift = SHIFTS[name]
    assert (before.scene.scale == after.scene.scale) == (shift.scale is None)
    assert np.array_equal(before.depth, after.depth) == (not shift.changes_image)
    assert (before.nuisances.lateral_friction == after.nuisances.lateral_friction) == (shift.friction is None)
    assert after.nuisances.mass_factor == pytest.approx(shift.mass * before.nuisances.mass_factor)


def test_values_are_those_of_the_names(objects: tuple[ObjectAsset, ...]) -> None:
    assert situations(objects, "scale-0.8")[1].scene.scale[0] == np.float32(0.8)
    low, high = (situations(objects, f"friction-{end}")[1].nuisances for end in ("low", "high"))
    assert (low.lateral_friction[0], high.lateral_friction[0]) == (np.float32(0.6), np.float32(1.0))
    assert (low.spinning_friction[0], high.spinning_friction[0]) == (np.float32(0.002), np.float32(0.006))
    assert SHIFTS["pybullet"].lift_test_config.engine == "pybullet"
    assert (SHIFTS["mass-1.3"].mass, SHIFTS["scale-1.2"].scale) == (1.3, 1.2)


def test_another_camera_sees_other_noise_of_the_same_scene(objects: tuple[ObjectAsset, ...]) -> None:
    kinect, stereo = (situation.depth for situation in situations(objects, "stereo"))
    both = (kinect > 0) & (stereo > 0)
    assert both.mean() > 0.8
    assert np.median(abs(kinect - stereo)[both]) < 0.004


@pytest.mark.parametrize(
    ("name", "again"),
    [
        ("none", ()),
        ("pybullet", ()),
        ("mass-0.7", ()),
        ("friction-low", OF_THE_OBJECT),
        ("stereo", OF_THE_IMAGE),
        ("scale-1.2", (*OF_THE_IMAGE, *OF_THE_OBJECT)),
    ],
)
def test_who_plans_again(name: str, again: tuple[str, ...]) -> None:
    assert {strategy for strategy in STRATEGIES if replans(strategy, SHIFTS[name])} == set(again)
    assert set(STRATEGIES) == {*KNOWS_NOTHING, *OF_THE_IMAGE, *OF_THE_OBJECT}


@pytest.mark.parametrize("name", ["mass-1.3", "friction-low"])
def test_known_grasps_are_those_that_would_be_found_again(
    benchmark: Benchmark, unshifted: tuple[SceneResult, ...], name: str
) -> None:
    shifted = replace(benchmark, shift=SHIFTS[name])
    searched, repeated = run(shifted, 2), run(shifted, 2, known=unshifted)
    assert [timeless(result) for result in searched] == [timeless(result) for result in repeated]
    for before, after in zip(unshifted, repeated, strict=True):
        for strategy, trial in after.trials.items():
            same = trial.seconds == before.trials[strategy].seconds
            assert same == (not replans(strategy, SHIFTS[name])), strategy
        if name == "mass-1.3":
            assert after.mass_factor == pytest.approx(1.3 * before.mass_factor)


def test_a_grasp_is_judged_in_the_other_engine(benchmark: Benchmark, unshifted: tuple[SceneResult, ...]) -> None:
    pytest.importorskip("pybullet")
    (judged,) = run(replace(benchmark, shift=SHIFTS["pybullet"]), 1, known=unshifted)
    for name, trial in judged.trials.items():
        assert trial.position == unshifted[0].trials[name].position
        assert trial.outcome in {"success", "dropped", "no_contact", "collision", "unreachable"}


def test_shift_and_engine_are_part_of_a_run(benchmark: Benchmark, untrained: Path) -> None:
    card = read_card(untrained)
    shifts = (*SHIFTS.values(), find_shift("mass-0.7", "pybullet"))
    identities = [str(replace(benchmark, shift=shift).identity(card)) for shift in shifts]
    assert len(set(identities)) == len(shifts)
    assert str(benchmark.identity(card)) == identities[0]


def test_an_engine_may_be_named_beside_a_shift() -> None:
    assert find_shift("none") is NONE
    assert find_shift("pybullet").engine == "pybullet"
    assert find_shift("mass-0.7", "pybullet") == replace(SHIFTS["mass-0.7"], engine="pybullet")
    with pytest.raises(InvalidConfigurationError, match="leave out"):
        find_shift("pybullet", "mujoco")


def test_what_is_no_shift_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="friction-low"):
        find_shift("moon")
    with pytest.raises(InvalidConfigurationError, match="positive"):
        Shift("light", mass=0.0)
    with pytest.raises(InvalidConfigurationError, match="positive"):
        Shift("flat", scale=-1.0)
    with pytest.raises(InvalidConfigurationError, match="friction"):
        Shift("ice", friction=-0.1)
