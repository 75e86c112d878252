"""``bayesgrasp train`` on a small set from cheap simulators: a model that loads, resume, and clear refusals."""

import json
from pathlib import Path

import pytest
import torch

from bayesgrasp.cli.main import main
from bayesgrasp.ratio.checkpoint import load_model
from bayesgrasp.types import Hands

OPTIONS = ["--epochs", "1", "--batch-size", "8", "--preset", "paper"]
PARTS = ["--estimators", "success_ratio", "image"]


def run(*words: str | Path) -> None:
    main(["train", *map(str, words)])


def test_a_model_is_trained_loaded_and_resumed(
    training_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "model"
    run("--data", training_set, "--out", out, *OPTIONS, *PARTS)
    assert "image: held-out loss" in capsys.readouterr().out
    model = load_model(out)
    assert model.card["objects"] == [
        item["id"] for item in json.loads((training_set / "manifest.json").read_text())["objects"]
    ]
    assert 0 < model.card["success_rate"] < 0.2
    assert model.card["prior"]["kappa"] == 30.0
    metrics = model.card["estimators"]["image"]["metrics"]
    assert {"balance", "mean_ratio", "mean_log_ratio"} == metrics["checks"].keys()
    some = Hands(torch.tensor([[0.0, 0.0, 0.2]]), torch.eye(3)[None], torch.tensor([1]))
    value = model.given_image(torch.full((1, 160, 256), 0.7))(some)
    assert value.isfinite().all()

    with pytest.raises(SystemExit):
        run("--data", training_set, "--out", out, *OPTIONS, *PARTS)
    assert "--resume" in capsys.readouterr().err
    run("--data", training_set, "--out", out, *OPTIONS, *PARTS, "--resume")
    torch.testing.assert_close(load_model(out).given_image(torch.full((1, 160, 256), 0.7))(some), value)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--epochs", "0"], "epochs"),
        (["--learning-rate", "-1"], "learning_rate"),
        (["--device", "toaster"], "the device 'toaster' cannot be used"),
        (["--batch-size", "0"], "batch_size must be at least 1"),
    ],
)
def test_wrong_options_are_one_clear_error(
    training_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    with pytest.raises(SystemExit) as stop:
        run("--data", training_set, "--out", tmp_path / "model", *words)
    assert stop.value.code == 2
    assert message in capsys.readouterr().err


def test_missing_data_is_one_clear_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        run("--data", tmp_path / "nothing", "--out", tmp_path / "model")
    assert stop.value.code == 2
    assert "error:" in capsys.readouterr().err
