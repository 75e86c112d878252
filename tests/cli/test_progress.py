"""The bars of the commands: what they count, what they say, and that a refused run leaves no log."""

import importlib.util
from pathlib import Path

import pytest

from bayesgrasp.cli.progress import counting, downloading, generating, training
from bayesgrasp.generation.run import Progress
from bayesgrasp.training.presets import Setup, preset
from bayesgrasp.training.train_estimator import Progress as Step


def test_counted_work_ends_at_its_total(capsys: pytest.CaptureFixture[str]) -> None:
    with counting("posteriors", 3) as show:
        show(5)
    assert "posteriors" in (printed := capsys.readouterr().out)
    assert "3/3" in printed


def test_generated_attempts_stand_with_what_was_found(capsys: pytest.CaptureFixture[str]) -> None:
    with generating(100) as show:
        show(Progress(attempts=40, successes=2, scenes=7, total=100, made=0))
    assert "40/100" in (printed := capsys.readouterr().out)
    assert "2 successes, 7 images, -/s" in printed


def test_each_estimator_has_a_bar_and_the_log_begins_with_the_first_step(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with training(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []
    with training(tmp_path) as show:
        for part in preset("best", Setup(), ("success", "full")):
            show(part, Step(epoch=0, step=1, epochs=2, steps=2, loss=0.5, learning_rate=1e-3, validation=0.25))
    printed = capsys.readouterr().out
    for words in ("success", "full", "2/4", "loss 0.5000, held out 0.2500 after epoch 1"):
        assert words in printed
    if importlib.util.find_spec("tensorboard") is not None:
        assert list((tmp_path / "logs").iterdir())


def test_a_new_download_takes_the_place_of_the_last() -> None:
    with downloading() as begin:
        begin("first")(10, 100)
        report = begin("second")
        report(5, None)
        report(100, 100)
