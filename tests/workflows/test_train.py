"""Training as a function: data in, a model on disk and its metrics out, with options for each estimator."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from training_set import MANIFEST, make_training_set

from bayesgrasp.errors import CheckpointError, DataError
from bayesgrasp.ratio.checkpoint import load_model
from bayesgrasp.training.presets import Part
from bayesgrasp.training.train_estimator import Progress, TrainConfig
from bayesgrasp.workflows.train import TrainOptions, train

QUICK = TrainConfig(epochs=1, bf16=False)


@pytest.fixture(scope="module")
def model(training_set: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The estimator without images, which trains in a moment."""
    out = tmp_path_factory.mktemp("train") / "model"
    train(training_set, out, TrainOptions(estimators=("success_ratio",), schedule=QUICK))
    return out


def test_each_estimator_has_its_epochs_and_every_step_is_told(training_set: Path, tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []

    def listen(part: Part, progress: Progress) -> None:
        told.append((part.role, progress.epoch, progress.epochs))

    options = TrainOptions(estimators=("success_ratio", "full"), schedule=QUICK, epochs={"success_ratio": 2})
    metrics = train(training_set, tmp_path / "model", options, progress=listen)
    assert list(metrics) == ["success_ratio", "full"]
    assert [len(values["validation_loss"]) for values in metrics.values()] == [2, 1]
    assert {role: (last, epochs) for role, last, epochs in told} == {"success_ratio": (1, 2), "full": (0, 1)}
    assert load_model(tmp_path / "model").card["estimators"]["full"]["metrics"]["best_epoch"] == 0


def test_training_starts_from_another_model_of_the_same_hand(training_set: Path, model: Path, tmp_path: Path) -> None:
    still = replace(QUICK, learning_rate=1e-12, weight_decay=0.0)
    options = TrainOptions(estimators=("success_ratio",), schedule=still)
    train(training_set, tmp_path / "again", options, start=model)
    old, new = (load_model(one).estimators["success_ratio"].state_dict() for one in (model, tmp_path / "again"))
    for name, value in old.items():
        torch.testing.assert_close(new[name], value, rtol=0, atol=1e-6)
    other = make_training_set(tmp_path / "other", 300, manifest=replace(MANIFEST, gripper="two-fingers"))
    with pytest.raises(CheckpointError, match="not for 'two-fingers'"):
        train(other, tmp_path / "nothing", options, start=model)
    assert not (tmp_path / "nothing").exists()


def test_practice_of_another_hand_is_refused(training_set: Path, tmp_path: Path) -> None:
    other = make_training_set(tmp_path / "other", 300, manifest=replace(MANIFEST, gripper_sha256=64 * "0"))
    with pytest.raises(DataError, match=r"other is for the gripper 'robotiq-3f' of description 00000000, not for"):
        train(training_set, tmp_path / "nothing", practice=[other])
    assert not (tmp_path / "nothing").exists()


def test_a_finished_model_is_not_overwritten(training_set: Path, model: Path) -> None:
    with pytest.raises(CheckpointError, match="holds a run already"):
        train(training_set, model)
