"""The transfer command: a table of losses, and a benchmark's files for every shift."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from untrained_model import save_untrained

from bayesgrasp.cli.main import main

CHOSEN = ("--strategies", "top_down", "mle_success_ratio")
OPTIONS = ("--split", "household_tea_box", *CHOSEN, "--seed", "2", "--workers", "1")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_untrained(tmp_path_factory.mktemp("transfer") / "model")


def run(model: Path, *args: str) -> None:
    main(["transfer", "--model", str(model), *args])


def test_losses_and_their_resumption(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(model, *OPTIONS, "--out", str(tmp_path), "--attempts", "1", "--shifts", "mass-0.7")
    first = (tmp_path / "mass-0.7" / "scenes.jsonl").read_text()
    more = ("--shifts", "mass-0.7", "stereo", "--attempts", "2", "--resume")
    run(model, *OPTIONS, "--out", str(tmp_path), *more)
    assert (tmp_path / "mass-0.7" / "scenes.jsonl").read_text().startswith(first)
    summary = json.loads((tmp_path / "transfer.json").read_text())
    assert summary["scenes"] == 2
    for shifts in summary["strategies"].values():
        assert list(shifts) == ["none", "mass-0.7", "stereo"]
        assert {"success_rate", "hold_rate", "success_lost", "hold_lost"} <= set(shifts["stereo"])
        assert shifts["mass-0.7"]["same_grasp"] == 2
    assert "| `top_down` | stereo |" in capsys.readouterr().out
    assert "| `top_down` | stereo |" in (tmp_path / "transfer.md").read_text()
    assert np.asarray(Image.open(tmp_path / "transfer.png")).std() > 10
    assert json.loads((tmp_path / "stereo" / "summary.json").read_text())["shift"] == "stereo"
    assert "| `top_down` |" in (tmp_path / "stereo" / "table.md").read_text()


def test_wrong_input_is_one_clear_error(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for extra, named in (
        (("--shifts", "moon"), "friction-low"),
        (("--shifts", "none"), "another than none"),
        (("--attempts", "0"), "at least 1"),
    ):
        with pytest.raises(SystemExit) as exit_info:
            run(model, *OPTIONS, "--out", str(tmp_path / "run"), *extra)
        assert exit_info.value.code == 2
        assert named in capsys.readouterr().err
