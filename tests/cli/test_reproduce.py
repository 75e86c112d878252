"""The whole experiment: stages are done once and in order, and the small one climbs the ladder."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from bayesgrasp.cli.experiment import Experiment
from bayesgrasp.cli.reproduce import Stages
from bayesgrasp.cli.scales import SCALES
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.chunks import GenerateConfig


def test_a_stage_is_done_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    calls: list[str] = []
    for _ in range(2):
        stages = Stages(tmp_path / "x", {"seed": 1, "box": (1, 2)})
        for name in ("data", "training"):
            stages.run(name, lambda name=name: calls.append(name))
    assert calls == ["data", "training"]
    assert capsys.readouterr().out.splitlines()[-1] == "training: done before"


def test_a_stage_that_fails_is_repeated(tmp_path: Path) -> None:
    def fail() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Stages(tmp_path, {}).run("data", fail)
    assert Stages(tmp_path, {}).done == []


def test_another_experiment_is_refused(tmp_path: Path) -> None:
    Stages(tmp_path, {"scale": "small", "seed": 1})
    with pytest.raises(InvalidConfigurationError, match="scale small, seed 1"):
        Stages(tmp_path, {"scale": "small", "seed": 2})
    (tmp_path / "experiment.json").write_text("[]")
    with pytest.raises(InvalidConfigurationError, match="cannot be read"):
        Stages(tmp_path, {"scale": "small", "seed": 1})


def test_the_full_experiment_is_the_papers() -> None:
    """All rows of the table, 1000 attempts each, and never a look at the unseen objects before the benchmark."""
    full = SCALES["full"]
    assert set(full.estimators) >= {"success_ratio", "success", "full"}
    assert full.scenes == 1000
    assert full.split == "train"
    assert {"train", "unseen"} <= set(full.judged)
    drawn, usual = (full.proposal, full.attempts_per_draw, full.scenes_per_draw), GenerateConfig()
    assert drawn == (usual.proposal, usual.attempts_per_draw, usual.scenes_per_draw) == ("prior", 256, 8)
    assert full.attempts >= 10**6


def test_the_full_experiment_practises_as_the_shipped_weights_did(tmp_path: Path) -> None:
    """Each round starts from the last version of its estimator, and the model has the last of all."""
    experiment = Experiment(tmp_path, SCALES["full"], 0, 1, "cpu", None)
    names = list(experiment.stages())
    assert names[:5] == ["data", "training", "practice 1", "training 1", "practice 2"]
    assert names.index("training 3") + 1 == names.index("model") == names.index("diagnostics") - 1
    rounds = SCALES["full"].rounds
    assert [one.estimator for one in rounds] == ["success", "success", "full"]
    latest = [experiment._latest(one.estimator, n + 1).name for n, one in enumerate(rounds)]
    assert latest == ["model-0", "model-1", "model-0"]
    assert rounds[2].copies == 0


def test_the_small_experiment_climbs_the_ladder(tmp_path: Path) -> None:
    """Prior < no image < image < full observation, in minutes; in a process of its own, as a user would run it."""
    words = ["reproduce", "--out", str(tmp_path / "small"), "--scale", "small", "--workers", "2"]
    command = [sys.executable, "-c", "from bayesgrasp.cli.main import main; main()", *words]
    subprocess.run(command, check=True, capture_output=True)
    summary = json.loads((tmp_path / "small" / "benchmark-stand-ins" / "summary.json").read_text())
    ladder = ("prior_sample", "map_metric", "map_image", "map_full")
    rates = [summary["strategies"][name]["success_rate"] for name in ladder]
    assert rates == sorted(rates)
    assert len(set(rates)) == len(rates), rates
    page = (tmp_path / "small" / "report.html").read_text()
    assert page.count('src="data:image/png;base64,') == 8
    assert "There is no" not in page
    again = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert again.count("done before") == 7
