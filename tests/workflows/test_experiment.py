"""The whole experiment: stages are done once and in order, from the last version of each estimator."""

from pathlib import Path

import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.chunks import GenerateConfig
from bayesgrasp.workflows.reproduce import Experiment
from bayesgrasp.workflows.scales import SCALES
from bayesgrasp.workflows.stages import Stages, Watcher


class Listener(Watcher):
    """Keeps what it hears of stages."""

    def __init__(self) -> None:
        self.heard: list[tuple[str, bool]] = []

    def stage(self, name: str, done: bool) -> None:
        self.heard.append((name, done))


def test_a_stage_is_done_once(tmp_path: Path) -> None:
    calls: list[str] = []
    listener = Listener()
    for _ in range(2):
        stages = Stages(tmp_path / "x", {"seed": 1, "box": (1, 2)})
        for name in ("data", "training"):
            stages.run(name, lambda name=name: calls.append(name), listener)
    assert calls == ["data", "training"]
    assert listener.heard == [("data", False), ("training", False), ("data", True), ("training", True)]


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


def test_the_papers_experiment_is_the_papers() -> None:
    """All rows of the table, 1000 attempts each, and never a look at the unseen objects before the benchmark."""
    paper = SCALES["paper"]
    assert set(paper.estimators) >= {"success_ratio", "success", "full"}
    assert paper.scenes == 1000
    assert paper.split == "train"
    assert {"train", "unseen"} <= set(paper.judged)
    drawn, usual = (paper.proposal, paper.attempts_per_draw, paper.scenes_per_draw), GenerateConfig()
    assert drawn == (usual.proposal, usual.attempts_per_draw, usual.scenes_per_draw) == ("prior", 256, 8)
    assert paper.attempts >= 10**6


def test_the_papers_experiment_practises_as_the_shipped_weights_did(tmp_path: Path) -> None:
    """Each round starts from the last version of its estimator, and the model has the last of all."""
    experiment = Experiment(tmp_path, SCALES["paper"])
    names = list(experiment.stages())
    assert names[:5] == ["data", "training", "practice 1", "training 1", "practice 2"]
    assert names.index("training 3") + 1 == names.index("model") == names.index("diagnostics") - 1
    rounds = SCALES["paper"].rounds
    assert [one.estimator for one in rounds] == ["success", "success", "full"]
    latest = [experiment.latest(one.estimator, n + 1).name for n, one in enumerate(rounds)]
    assert latest == ["model-0", "model-1", "model-0"]
    assert rounds[2].deform.copies == 0


def test_the_general_experiment_gathers_before_it_learns(tmp_path: Path) -> None:
    """Rounds without epochs only gather practice, and whoever comes next starts from the last that was trained."""
    general = SCALES["general"]
    experiment = Experiment(tmp_path, general)
    names = list(experiment.stages())
    assert names[:5] == ["data", "practice 1", "practice 2", "training 2", "practice 3"]
    latest = [experiment.latest(one.estimator, n + 1).name for n, one in enumerate(general.rounds)]
    assert latest == ["paper", "paper", "model-2", "model-2"], "it starts from the paper's model"
    assert [one.explore for one in general.rounds] == [12, 12, 3, 3]
    assert general.cameras == "any"
    assert not any("unseen" in (one.split or general.split) for one in general.rounds)
