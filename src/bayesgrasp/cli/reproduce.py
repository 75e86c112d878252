"""``bayesgrasp reproduce``: the whole experiment, from simulations to one page of results."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from bayesgrasp.cli.benchmark import print_skipped
from bayesgrasp.cli.demo import print_demonstration
from bayesgrasp.cli.diagnose import print_report
from bayesgrasp.cli.generate import print_data
from bayesgrasp.cli.progress import benchmarking, counting, generating, training
from bayesgrasp.cli.train import print_training
from bayesgrasp.data.manifest import Manifest
from bayesgrasp.diagnostics.posterior_report import Report
from bayesgrasp.evaluation.demonstration import Demonstration
from bayesgrasp.evaluation.journal import SceneResult
from bayesgrasp.evaluation.tables import markdown
from bayesgrasp.generation.run import Progress
from bayesgrasp.training.train_model import Watch
from bayesgrasp.workflows.evaluate import Evaluation
from bayesgrasp.workflows.reproduce import reproduce as run
from bayesgrasp.workflows.scales import ScaleName
from bayesgrasp.workflows.stages import Watcher


def reproduce(
    out: Path,
    scale: ScaleName = "paper",
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
        scale: small (minutes, household stand-ins only, 8,192 adaptive lift tests), paper (hours, needs the YCB scans:
            10^6 lift tests from the prior, 256 and 8 images for each drawn mesh and scale, and practice) or general
            (hours, needs the scans, too: also three thousand procedural objects, seen from anywhere).
        seed: Of all random numbers; the benchmark uses the next one.
        workers: Processes.
        device: Where to train: cpu, cuda, or cuda:N.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
    """
    page = run(out, scale, seed=seed, workers=workers, device=device, ycb_dir=ycb_dir, watcher=_Terminal())
    print(f"report: {page}")


class _Terminal(Watcher):
    """Shows each stage as its own command would."""

    def stage(self, name: str, done: bool) -> None:
        print(f"{name}: done before" if done else f"{name}:")

    def generating(self, total: int) -> AbstractContextManager[Callable[[Progress], None]]:
        return generating(total)

    def generated(self, manifest: Manifest, out: Path) -> None:
        print_data(manifest, out)

    def training(self, out: Path) -> AbstractContextManager[Watch]:
        return training(out)

    def trained(self, metrics: Mapping[str, dict[str, Any]], out: Path) -> None:
        print_training(metrics, out)

    def calibrating(self, total: int) -> AbstractContextManager[Callable[[int], None]]:
        return counting("posteriors", total)

    def calibrated(self, report: Report, figures: Sequence[Path]) -> None:
        print_report(report, figures)

    def evaluating(self, evaluation: Evaluation, total: int) -> AbstractContextManager[Callable[[SceneResult], None]]:
        print_skipped(evaluation)
        return benchmarking(total)

    def evaluated(self, summary: Mapping[str, Any], out: Path) -> None:
        print(markdown(summary, summary["split"]), end="")
        print(f"wrote {out}")

    def shown(self, demonstration: Demonstration, picture: Path) -> None:
        print_demonstration(demonstration, picture)
