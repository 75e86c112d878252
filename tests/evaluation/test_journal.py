"""The file of a run: nothing is lost, nothing of another run is taken."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bayesgrasp.errors import DataError
from bayesgrasp.evaluation.journal import FILE, Journal, SceneResult, Trial

IDENTITY = {"seed": 1, "objects": {"mug": "abc"}, "search": {"steps": 20, "box": (1, 2)}}
Make = Callable[..., SceneResult]


def test_a_result_survives_its_line(result: Make) -> None:
    made = result(3, {"map_image": "success", "top_down": "dropped"})
    assert SceneResult.from_line(made.to_line()) == made
    attempt = made.attempt("map_image")
    assert attempt is not None
    np.testing.assert_array_equal(attempt.position, np.float32([[0.1, 0.0, 0.2]]))
    assert attempt.object_pose.dtype == np.float32


def test_no_plan_has_no_attempt(result: Make) -> None:
    declined = SceneResult(**{**vars(result(0, {})), "trials": {"plan": Trial("no_plan", 0.1)}})
    assert declined.attempt("plan") is None
    assert SceneResult.from_line(declined.to_line()) == declined


def test_a_run_goes_on_after_a_torn_line(tmp_path: Path, result: Make) -> None:
    journal = Journal(tmp_path, IDENTITY, resume=False)
    for number in range(3):
        journal.add(result(number, {"plan": "success"}))
    whole = (tmp_path / FILE).read_text()
    (tmp_path / FILE).write_text(whole[:-20])
    resumed = Journal(tmp_path, IDENTITY, resume=True)
    assert sorted(resumed.results) == [0, 1]
    resumed.add(result(2, {"plan": "success"}))
    assert (tmp_path / FILE).read_text() == whole


def test_a_run_with_the_former_names_of_strategies_goes_on(tmp_path: Path, result: Make) -> None:
    former, now = ({**IDENTITY, "strategies": [f"map_{kind}"]} for kind in ("metric", "success_ratio"))
    Journal(tmp_path, former, resume=False).add(result(0, {"map_metric": "success"}))
    resumed = Journal(tmp_path, now, resume=True)
    assert list(resumed.results[0].trials) == ["map_success_ratio"]
    with pytest.raises(DataError, match="strategies differ"):
        Journal(tmp_path, {**IDENTITY, "strategies": ["map_image"]}, resume=True)


def test_a_run_that_is_there_is_not_overwritten(tmp_path: Path) -> None:
    Journal(tmp_path, IDENTITY, resume=False)
    with pytest.raises(DataError, match="--resume"):
        Journal(tmp_path, IDENTITY, resume=False)


def test_another_run_is_refused(tmp_path: Path) -> None:
    Journal(tmp_path, IDENTITY, resume=False)
    with pytest.raises(DataError, match=r"another run \(seed differ\)"):
        Journal(tmp_path, {**IDENTITY, "seed": 2}, resume=True)


def test_another_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text("hello\n")
    with pytest.raises(DataError, match="damaged"):
        Journal(tmp_path, IDENTITY, resume=True)


@pytest.mark.parametrize(
    "line",
    [
        "[]",
        "3",
        "{}",
        "\x00",
        '{"identity": 3}',
        "[" * 2000,
        '{"trials": [1]}',
    ],
)
def test_a_line_of_something_else_is_refused(tmp_path: Path, line: str, result: Make) -> None:
    Journal(tmp_path, IDENTITY, resume=False).add(result(0, {"plan": "success"}))
    first, second = (tmp_path / FILE).read_text().splitlines()
    for lines in ((line, second), (first, line), (first, second.replace('"number": 0', '"number": "0"'))):
        (tmp_path / FILE).write_text("\n".join(lines) + "\n")
        with pytest.raises(DataError, match="is damaged") as refused:
            Journal(tmp_path, IDENTITY, resume=True)
        assert len(str(refused.value)) < 400
