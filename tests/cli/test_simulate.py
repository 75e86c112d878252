"""The simulate command: JSON for machines, a table for people, one clear error for wrong input."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bayesgrasp.cli.main import main
from bayesgrasp.types import Outcome


def run(*args: str) -> None:
    main(["simulate", *args])


def fails(capsys: pytest.CaptureFixture[str], *args: str) -> str:
    with pytest.raises(SystemExit) as exit_info:
        run(*args)
    assert exit_info.value.code == 2
    return capsys.readouterr().err


def test_json_table_and_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report, picture = tmp_path / "report.json", tmp_path / "film.png"
    options = ("--attempts", "100", "--split", "household_drink_can", "--workers", "1", "--seed", "3")
    run(*options, "--json", str(report), "--video", str(picture))
    summary = json.loads(report.read_text())
    assert summary["attempts"] == 100
    assert sum(summary["outcomes"].values()) == 100
    assert set(summary["outcomes"]) == {o.name.lower() for o in Outcome}
    assert summary["success_rate"] == summary["outcomes"]["success"] / 100
    assert summary["attempts_per_second"] > 0
    assert summary["per_object"]["household_drink_can"]["outcomes"] == summary["outcomes"]
    assert "household_drink_can" in capsys.readouterr().out
    image = np.asarray(Image.open(picture))
    assert image.std() > 10, "the picture shows something"


def test_wrong_input_is_one_clear_error(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert "no_such_thing" in fails(capsys, "--split", "no_such_thing")
    assert "attempt" in fails(capsys, "--split", "household_ball", "--attempts", "0")
    assert "no directory" in fails(capsys, "--split", "household_ball", "--json", str(tmp_path / "no" / "x.json"))
    assert ".png or .gif" in fails(capsys, "--split", "household_ball", "--video", str(tmp_path / "x.mp4"))
    assert "mass" in fails(capsys, "--mesh", str(tmp_path / "x.stl"))
    assert not list(tmp_path.iterdir())


def test_the_engine_and_the_criterion_can_be_chosen(tmp_path: Path) -> None:
    pytest.importorskip("pybullet", reason="the second engine is the optional extra bayesgrasp[pybullet]")
    report = tmp_path / "report.json"
    options = ("--attempts", "60", "--split", "household_ball", "--workers", "1", "--seed", "4")
    run(*options, "--engine", "pybullet", "--criterion", "hold", "--json", str(report))
    summary = json.loads(report.read_text())
    assert (summary["engine"], summary["criterion"]) == ("pybullet", "hold")
    assert sum(summary["outcomes"].values()) == 60
