"""``bayesgrasp diagnose`` on a small set and an untrained model: every number is there; wrong options are refused."""

import json
import math
from dataclasses import replace
from pathlib import Path

import fake_world
import pytest

from bayesgrasp.cli.main import main
from bayesgrasp.generation.pool import InProcess
from bayesgrasp.generation.run import Run, open_store
from bayesgrasp.ratio.checkpoint import Origin, save_model
from bayesgrasp.ratio.estimators import ImageConfig
from bayesgrasp.ratio.kinds import build
from bayesgrasp.ratio.layers import ConvConfig
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.training.train_estimator import initialised


def model(directory: Path, seed: int) -> Path:
    config = ImageConfig(encoder=ConvConfig(channels=(4, 4, 4, 4), width=8), widths=(16,))
    estimator = initialised(lambda: build("global", config), seed).eval()
    save_model(directory, {"success": estimator}, Origin(robotiq_3f().name))
    return directory


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("diagnose") / "data"
    manifest = replace(fake_world.manifest(), gripper=robotiq_3f().name)
    Run(open_store(directory, manifest, False), fake_world.recipe(), 3000).execute(InProcess())
    return directory


def test_every_number_is_reported_and_every_figure_drawn(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    models = [model(tmp_path / name, seed) for seed, name in enumerate(("one", "two"))]
    words = ["--model", models[0], "--data", data, "--ensemble", models[1], "--truths", 20, "--proposals", 200]
    kept = ["--json", tmp_path / "report.json", "--out", tmp_path / "figures"]
    main(["diagnose", *map(str, words + kept), "--workers", "1"])
    content = json.loads((tmp_path / "report.json").read_text())
    coverage = content["expected_coverage"]
    assert len(coverage["levels"]) == len(coverage["coverage"]) == 19
    assert 0 <= coverage["max_error"] <= 1
    assert content["sbc"].keys() == {"x", "y", "z", "approach_angle", "yaw", "type"}
    assert content["tarp"]["count"] == coverage["count"] > 0
    assert 0 <= content["reliability"]["ece"] <= 1
    assert content["ensemble_spread"]["mean"] > 0
    assert math.isfinite(content["effective_sample_size"])
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert names == {"coverage.png", "sbc.png", "tarp.png", "reliability.png", "spread.png"}
    assert "expected coverage: largest error" in capsys.readouterr().out


def test_fresh_successes_are_simulated_and_judged(tmp_path: Path) -> None:
    words = ["--fresh", "3", "--proposals", "200", "--split", "stand-ins", "--workers", "1"]
    main(["diagnose", "--model", str(model(tmp_path, 0)), *words, "--json", str(tmp_path / "report.json")])
    content = json.loads((tmp_path / "report.json").read_text())
    assert content["expected_coverage"]["count"] == 3
    assert 0 < content["reliability"]["brier"] < 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "either --data DIR or --fresh N"),
        (["--data", "x", "--fresh", "5"], "either --data DIR or --fresh N"),
        (["--data", "x", "--model", "nothing"], "no model in nothing"),
    ],
)
def test_wrong_options_are_one_clear_error(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["diagnose", *words])
    assert stop.value.code == 2
    assert message in capsys.readouterr().err
