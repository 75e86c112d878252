"""The benchmark command: tables for people, JSON for machines, resume, one clear error for wrong input."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from untrained_model import save_untrained

from bayesgrasp.cli.main import main

NAMED = ("--strategies", "prior_sample", "mle_full", "top_down", "force_closure", "plan")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_untrained(tmp_path_factory.mktemp("benchmark") / "model")


def run(model: Path, *args: str) -> None:
    main(["benchmark", "--model", str(model), "--workers", "1", *args])


def fails(capsys: pytest.CaptureFixture[str], model: Path, *args: str) -> str:
    with pytest.raises(SystemExit) as exit_info:
        run(model, *args)
    assert exit_info.value.code == 2
    return capsys.readouterr().err


def test_results_and_their_resumption(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, report = tmp_path / "run", tmp_path / "report.json"
    options = ("--split", "household_tea_box", *NAMED, "--seed", "2", "--out", str(out))
    run(model, *options, "--attempts", "1")
    first = (out / "scenes.jsonl").read_text()
    run(model, *options, "--attempts", "2", "--resume", "--json", str(report))
    assert (out / "scenes.jsonl").read_text().startswith(first)
    summary = json.loads(report.read_text())
    assert list(summary["strategies"]) == list(NAMED[1:])
    for entry in summary["strategies"].values():
        assert {"success_rate", "interval", "attempts", "unreachable", "seconds_per_plan", "per_object"} <= set(entry)
        assert 0 <= entry["hold_rate"] <= entry["success_rate"]
        assert entry["hold_interval"][0] <= entry["hold_rate"] <= entry["hold_interval"][1]
        assert entry["attempts"] == 2
        assert entry["per_object"]["household_tea_box"]["attempts"] == 2
    assert summary["skipped"] == {}
    assert json.loads((out / "summary.json").read_text()) == summary
    assert "| `top_down` |" in capsys.readouterr().out
    assert "household_tea_box" in (out / "per_object.md").read_text()
    for figure in ("ladder.png", "per_object.png"):
        assert np.asarray(Image.open(out / figure)).std() > 10
    assert "--resume" in fails(capsys, model, *options)


def test_skipped_strategies_are_said(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(model, "--split", "household_ball", "--attempts", "1", "--strategies", "prior_sample", "map_full")
    printed = capsys.readouterr().out
    assert "map_full: skipped: the model never had household_ball" in printed
    assert "| `map_full` |" not in printed


def test_a_shift_is_named_in_the_results_and_is_another_run(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--split", "household_tea_box", "--strategies", "top_down", "--attempts", "1", "--out", str(tmp_path))
    run(model, *options, "--shift", "friction-low")
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["shift"], summary["engine"]) == ("friction-low", "mujoco")
    assert "shift differ" in fails(capsys, model, *options, "--resume")
    assert "there is no shift 'moon'" in fails(capsys, model, *options, "--shift", "moon")


def test_wrong_input_is_one_clear_error(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "map_full" in fails(capsys, model, "--split", "household_ball", "--strategies", "luck")
    assert "at least 1" in fails(capsys, model, "--split", "household_ball", "--attempts", "0")
    assert "--out" in fails(capsys, model, "--split", "household_ball", "--resume")
    assert "no directory" in fails(capsys, model, "--json", str(tmp_path / "no" / "x.json"))
    assert "no model" in fails(capsys, tmp_path, "--split", "household_ball")
