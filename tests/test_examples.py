"""Every example runs, in small, and finds what it is about."""

import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bayesgrasp.generation.pool import InProcess
from bayesgrasp.types import Outcome

EXAMPLES = Path(__file__).parents[1] / "examples"


def example(name: str) -> Callable[..., Any]:
    """The main function of an example."""
    main: Callable[..., Any] = runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"]
    return main


@pytest.fixture(autouse=True)
def _elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


def test_own_hand() -> None:
    """Along its length the box does not fit between two fingers; three enclose it either way."""
    lifted = example("own_hand")(turns=2)
    assert lifted == {"two-fingers": [90.0], "robotiq-3f": [0.0, 90.0]}


def test_plan_on_an_image() -> None:
    """The picture that is taken where there is none is planned on through its files."""
    program = runpy.run_path(str(EXAMPLES / "plan_on_an_image.py"))
    files = Path("depth.png"), Path("camera.json")
    program["take_picture"](*files)
    plan = program["main"](*files)
    assert plan.reason is None
    assert plan.grasps[0].success_probability > 0.9


def test_sample_the_posterior() -> None:
    posterior = example("sample_the_posterior")(draws=64)
    assert posterior.log_prob(posterior.mode()) > posterior.log_prob(posterior.sample(64).hands).mean()


def test_own_objects(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("BAYESGRASP_CACHE_DIR", str(tmp_path / "cache"))
    program = runpy.run_path(str(EXAMPLES / "own_objects.py"))
    program["turn_bottle"](Path("bottle.stl"))
    assert program["main"](Path("bottle.stl"), 0.35, scenes=1) == [Outcome.SUCCESS]


def test_train_small() -> None:
    """Too little to learn from, but enough to go through."""
    example("train_small")(Path("small"), attempts=512, epochs=1, executor=InProcess())
    assert Path("small/model/success.safetensors").exists()


def test_no_example_is_forgotten() -> None:
    tested = {name.removeprefix("test_") for name in globals() if name.startswith("test_")}
    assert {path.stem for path in EXAMPLES.glob("*.py")} <= tested
