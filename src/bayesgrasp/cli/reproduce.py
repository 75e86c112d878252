"""``bayesgrasp reproduce``: the whole experiment, from simulations to one page of results."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

from bayesgrasp.cli.experiment import Experiment
from bayesgrasp.cli.scales import SCALES


def reproduce(
    out: Path,
    scale: Literal["small", "full"] = "full",
    seed: int = 0,
    workers: int = os.cpu_count() or 1,
    device: str = "cpu",
    ycb_dir: Path | None = None,
) -> None:
    """Run the whole experiment: data, training, diagnostics, benchmark, report.

    The result is --out/report.html, one page that needs no other file. A run that was interrupted goes on where it was
    when the command is given again; a finished stage is not repeated.

    Args:
        out: Directory of the experiment.
        scale: small (minutes, household stand-ins only, 32,768 adaptive lift tests) or full (hours, needs the YCB
            scans: 10^6 lift tests from the prior, 256 and 8 images for each drawn mesh and scale, and practice).
        seed: Of all random numbers; the benchmark uses the next one.
        workers: Processes.
        device: Where to train: cpu, cuda, or cuda:N.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
    """
    experiment = Experiment(out, SCALES[scale], seed, workers, device, ycb_dir)
    stages = Stages(out, {"scale": scale, "settings": asdict(SCALES[scale]), "seed": seed})
    for name, work in experiment.stages().items():
        stages.run(name, work)
    print(f"report: {out / 'report.html'}")


class Stages:
    """Which stages of an experiment are finished; kept in ``out/experiment.json``.

    Args:
        out: Directory of the experiment; made if it is not there.
        settings: What the experiment is; a directory with another one is refused.

    Raises:
        InvalidConfigurationError: The directory holds an experiment with other settings, or a damaged file.
    """

    def __init__(self, out: Path, settings: dict[str, Any]) -> None:
        from bayesgrasp.errors import InvalidConfigurationError

        self.path, self.settings = out / "experiment.json", json.loads(json.dumps(settings))
        self.done: list[str] = []
        out.mkdir(parents=True, exist_ok=True)
        if self.path.exists():
            try:
                content = json.loads(self.path.read_text(encoding="utf-8"))
                found, self.done = content["settings"], list(content["done"])
            except (ValueError, KeyError, TypeError) as error:
                raise InvalidConfigurationError(f"{self.path} cannot be read: {error}") from error
            if found != self.settings:
                raise InvalidConfigurationError(
                    f"{out} holds an experiment with other settings (scale {found.get('scale')}, seed "
                    f"{found.get('seed')}); give the same ones, or another --out"
                )
        self._write()

    def run(self, name: str, work: Callable[[], None]) -> None:
        """Do a stage, unless it is done."""
        if name in self.done:
            print(f"{name}: done before")
            return
        print(f"{name}:")
        work()
        self.done.append(name)
        self._write()

    def _write(self) -> None:
        partial = self.path.with_name(f".{self.path.name}.partial")
        partial.write_text(json.dumps({"settings": self.settings, "done": self.done}, indent=1) + "\n", "utf-8")
        os.replace(partial, self.path)
