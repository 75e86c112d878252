"""Scenes with household objects, and scene results that were made up."""

from collections.abc import Callable
from pathlib import Path

import pytest
from untrained_model import OBJECTS, save_untrained

from bayesgrasp.evaluation.journal import SceneResult, Trial
from bayesgrasp.evaluation.scenes import SceneMaker
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset


@pytest.fixture(scope="session")
def objects() -> tuple[ObjectAsset, ...]:
    return load_objects(OBJECTS)


@pytest.fixture(scope="session")
def scenes(objects: tuple[ObjectAsset, ...]) -> SceneMaker:
    return SceneMaker(objects, seed=3)


@pytest.fixture(scope="session")
def untrained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_untrained(tmp_path_factory.mktemp("untrained") / "model")


def make_result(number: int, outcomes: dict[str, str], object_id: str = "mug") -> SceneResult:
    """A result whose outcomes by strategy were made up."""
    trials = {
        name: Trial(outcome, 0.5, outcome == "success" and number % 2 == 0, (0.1, 0.0, 0.2), (1.0, 0.0, 0.0, 0.0), 1)
        for name, outcome in outcomes.items()
    }
    return SceneResult(number, object_id, 0, 1.0, (0.0, 0.01, 0.5), 0.8, 0.004, 1.0, trials)


@pytest.fixture(scope="session")
def result() -> Callable[..., SceneResult]:
    return make_result
