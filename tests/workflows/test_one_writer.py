"""Two processes in one folder: one of them is refused, whatever they do there."""

from collections.abc import Callable
from pathlib import Path

import pytest
from training_set import make_training_set
from untrained_model import OBJECTS, save_untrained

from bayesgrasp.errors import FileError
from bayesgrasp.generation.pool import InProcess
from bayesgrasp.locks import sole_writer
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.workflows.evaluate import Evaluation
from bayesgrasp.workflows.generate import GenerateJob, generate
from bayesgrasp.workflows.practise import PracticeJob, practise
from bayesgrasp.workflows.reproduce import reproduce
from bayesgrasp.workflows.train import train


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_untrained(tmp_path_factory.mktemp("untrained") / "model")


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_training_set(tmp_path_factory.mktemp("data") / "data", 3000)


WRITERS: dict[str, Callable[[Path, Path, Path], object]] = {
    "generate": lambda out, model, data: generate(GenerateJob(load_objects(OBJECTS), 8), out, InProcess()),
    "practise": lambda out, model, data: practise(PracticeJob(model, load_objects(OBJECTS), 1), out),
    "train": lambda out, model, data: train(data, out, resume=True),
    "evaluate": lambda out, model, data: Evaluation.of(model, load_objects(OBJECTS)).run(1, out=out, resume=True),
    "reproduce": lambda out, model, data: reproduce(out, "small"),
}


@pytest.mark.parametrize("name", WRITERS)
def test_the_second_one_is_refused_and_writes_nothing(name: str, tmp_path: Path, model: Path, data: Path) -> None:
    out = tmp_path / "out"
    with sole_writer(out), pytest.raises(FileError, match=r"another process is writing to .*out: wait"):
        WRITERS[name](out, model, data)
    left = {path.name for path in out.rglob("*")}
    # A data set is opened before it is locked; its manifest would be the same from both.
    assert left <= {"lock", "manifest.json", "attempts", "scenes"}
