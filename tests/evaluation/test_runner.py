"""The run: paired, resumable, and the same for any number of workers."""

from dataclasses import replace
from pathlib import Path

import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.journal import Journal, SceneResult
from bayesgrasp.evaluation.runner import Benchmark, run, skipped
from bayesgrasp.evaluation.strategies import FULL, STRATEGIES, SearchConfig
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.posterior.ascent import AscentConfig
from bayesgrasp.ratio.card import read_card
from bayesgrasp.types import Outcome
from bayesgrasp.workflows.evaluate import ModelContestants

QUICK = ("prior_sample", "mle_success_ratio", "map_full", "top_down")


@pytest.fixture(scope="module")
def benchmark(objects: tuple[ObjectAsset, ...], untrained: Path) -> Benchmark:
    search = SearchConfig(50, AscentConfig(steps=2))
    return Benchmark(objects, ModelContestants(untrained).load, QUICK, seed=5, search=search)


@pytest.fixture(scope="module")
def results(benchmark: Benchmark) -> tuple[SceneResult, ...]:
    return run(benchmark, 4)


def timeless(results: tuple[SceneResult, ...]) -> list[SceneResult]:
    """Results without their times."""
    return [replace(r, trials={name: replace(trial, seconds=0.0) for name, trial in r.trials.items()}) for r in results]


def test_the_number_of_workers_changes_nothing(benchmark: Benchmark, results: tuple[SceneResult, ...]) -> None:
    assert timeless(run(benchmark, 4, workers=2)) == timeless(results)


def test_a_resumed_run_is_the_undisturbed_one(
    benchmark: Benchmark, results: tuple[SceneResult, ...], untrained: Path, tmp_path: Path
) -> None:
    identity = benchmark.identity(read_card(untrained))
    run(benchmark, 2, journal=Journal(tmp_path, identity, resume=False))
    told: list[int] = []
    resumed = run(benchmark, 4, 1, Journal(tmp_path, identity, True), lambda result: told.append(result.number))
    assert timeless(resumed) == timeless(results)
    assert sorted(told) == [0, 1, 2, 3]
    assert len(run(benchmark, 1, journal=Journal(tmp_path, identity, resume=True))) == 1


def test_fewer_strategies_do_the_same(benchmark: Benchmark, results: tuple[SceneResult, ...]) -> None:
    (alone,) = timeless(run(replace(benchmark, strategies=("top_down",)), 1))
    assert alone.trials["top_down"] == timeless(results)[0].trials["top_down"]


def test_a_recorded_attempt_can_be_repeated(results: tuple[SceneResult, ...], objects: tuple[ObjectAsset, ...]) -> None:
    lift_test = LiftTest(objects)
    for result in results:
        for name, trial in result.trials.items():
            attempt = result.attempt(name)
            assert attempt is not None
            assert Outcome(int(lift_test.run(attempt)[0])).name.lower() == trial.outcome


def test_full_observation_is_skipped_on_new_objects(benchmark: Benchmark, untrained: Path) -> None:
    mixed = replace(benchmark, objects=load_objects(["household_tea_box", "household_ball"]))
    reasons = skipped(mixed, read_card(untrained))
    assert "household_ball" in reasons["map_full"]
    assert set(reasons) == {"map_full"}
    known, new = run(mixed, 2)
    assert "map_full" in known.trials
    assert "map_full" not in new.trials


def test_models_without_an_estimator_skip_its_strategies(benchmark: Benchmark, untrained: Path) -> None:
    card = read_card(untrained)
    del card["estimators"]["full"]
    assert set(skipped(replace(benchmark, strategies=STRATEGIES), card)) == set(FULL)


def test_identity_changes_with_what_matters(benchmark: Benchmark, untrained: Path) -> None:
    card = read_card(untrained)
    same = benchmark.identity(card)
    assert same == replace(benchmark).identity(card)
    for other in (replace(benchmark, seed=6), replace(benchmark, search=SearchConfig())):
        assert other.identity(card) != same


@pytest.mark.parametrize("changes", [{"objects": ()}, {"strategies": ()}, {"strategies": ("luck",)}])
def test_wrong_benchmarks_are_refused(benchmark: Benchmark, changes: dict[str, tuple[str, ...]]) -> None:
    with pytest.raises(InvalidConfigurationError, match="prior_sample"):
        replace(benchmark, **changes)


def test_at_least_one_attempt(benchmark: Benchmark) -> None:
    with pytest.raises(InvalidConfigurationError, match="at least 1"):
        run(benchmark, 0)
