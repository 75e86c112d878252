"""How far a long experiment is: which stages are finished, on disk, and what it tells those who watch it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from bayesgrasp.data.manifest import Manifest
from bayesgrasp.diagnostics.posterior_report import Report
from bayesgrasp.errors import InvalidConfigurationError, clipped
from bayesgrasp.evaluation.demonstration import Demonstration
from bayesgrasp.evaluation.journal import SceneResult
from bayesgrasp.files import MIB, make_directory, read_json, write_json
from bayesgrasp.generation.run import Progress
from bayesgrasp.training.train_model import Watch
from bayesgrasp.workflows.evaluate import Evaluation


def ignore(*_: object) -> None:
    """Listen to nothing."""


class Watcher:
    """What one may hear of an experiment; this one listens to nothing, others override what they want to hear."""

    def stage(self, name: str, done: bool) -> None:
        """A stage begins, or was done before."""

    def generating(self, total: int) -> AbstractContextManager[Callable[[Progress], None]]:
        """Around lift tests and images; what it gives is told after every chunk."""
        return nullcontext(ignore)

    def generated(self, manifest: Manifest, out: Path) -> None:
        """A data set is finished."""

    def training(self, out: Path) -> AbstractContextManager[Watch]:
        """Around the training of a model; what it gives is told after every step."""
        return nullcontext(ignore)

    def trained(self, metrics: Mapping[str, dict[str, Any]], out: Path) -> None:
        """A model is trained."""

    def calibrating(self, total: int) -> AbstractContextManager[Callable[[int], None]]:
        """Around the judging of posteriors; what it gives is told how many are judged."""
        return nullcontext(ignore)

    def calibrated(self, report: Report, figures: Sequence[Path]) -> None:
        """The posterior is judged."""

    def evaluating(self, evaluation: Evaluation, total: int) -> AbstractContextManager[Callable[[SceneResult], None]]:
        """Around a benchmark; what it gives is told every scene."""
        return nullcontext(ignore)

    def evaluated(self, summary: Mapping[str, Any], out: Path) -> None:
        """A benchmark is finished."""

    def shown(self, demonstration: Demonstration, picture: Path) -> None:
        """A grasp was planned, tried and drawn."""


class Stages:
    """Which stages of an experiment are finished; kept in ``out/experiment.json``.

    Args:
        out: Directory of the experiment; made if it is not there.
        settings: What the experiment is; a directory with another one is refused.

    Raises:
        InvalidConfigurationError: The directory holds an experiment with other settings, or a damaged file.
    """

    def __init__(self, out: Path, settings: dict[str, Any]) -> None:
        self.path, self.settings = out / "experiment.json", json.loads(json.dumps(settings))
        self.done: list[str] = []
        make_directory(out)
        if self.path.exists():
            try:
                content = read_json(self.path, MIB)
                found, self.done = dict(content["settings"]), list(content["done"])
            except (OSError, ValueError, KeyError, TypeError) as error:
                raise InvalidConfigurationError(f"{self.path} cannot be read: {clipped(error)}") from error
            if found != self.settings:
                raise InvalidConfigurationError(
                    f"{out} holds an experiment with other settings (scale {clipped(found.get('scale'), 20)}, seed "
                    f"{clipped(found.get('seed'), 20)}); give the same ones, or another --out"
                )
        self._write()

    def run(self, name: str, work: Callable[[], None], watcher: Watcher | None = None) -> None:
        """Do a stage, unless it is done."""
        (watcher or Watcher()).stage(name, name in self.done)
        if name not in self.done:
            work()
            self.done.append(name)
            self._write()

    def _write(self) -> None:
        write_json(self.path, {"settings": self.settings, "done": self.done})
