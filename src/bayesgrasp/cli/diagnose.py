"""``bayesgrasp diagnose``: is a trained posterior right?"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from bayesgrasp.cli.progress import counting
from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.diagnostics.posterior_report import Report
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.files import write_json
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.workflows.calibrate import CalibrationJob, calibrate
from bayesgrasp.workflows.load import model_directory
from bayesgrasp.workflows.success_pairs import Attempted, SuccessPairs, simulated_pairs, stored_pairs
from bayesgrasp.workflows.training_data import check_hands


@dataclass(frozen=True)
class Successes:
    """Which successes are to be found again, one of --data and --fresh.

    Attributes:
        data: Directory of a data set; its test split is used.
        fresh: Simulate this many new successes from the prior instead.
        truths: With --data, pairs of a successful hand and an image, at most.
        split: With --fresh, the objects; see `bayesgrasp generate`.
        ycb_dir: With --fresh, directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
    """

    data: Path | None = None
    fresh: int | None = None
    truths: int = 500
    split: str = "train"
    ycb_dir: Path | None = None

    def pairs(self, seed: int, workers: int) -> tuple[SuccessPairs, Iterator[Attempted]]:
        """Read or simulate them."""
        if self.data is not None:
            dataset, rng = GraspDataset(self.data), generator(seed, Stream.DIAGNOSED_PAIR)
            check_hands([dataset], robotiq_3f().identity)
            return stored_pairs(dataset, "test", self.truths, rng)
        objects, count = load_objects(self.split, self.ycb_dir), self.fresh or 0
        with counting("successes", count) as progress:
            return simulated_pairs(objects, count, seed, workers, progress)


def diagnose(
    model: Path | None = None,
    successes: Annotated[Successes, tyro.conf.OmitArgPrefixes] = Successes(),
    proposals: int = 10_000,
    ensemble: tuple[Path, ...] = (),
    json: Path | None = None,
    out: Path | None = None,
    seed: int = 0,
    workers: int = os.cpu_count() or 1,
) -> None:
    """Judge a trained posterior by simulated successes that it has not seen.

    Expected coverage of highest-density regions, simulation-based calibration, TARP, reliability of the success
    probability, and the disagreement of an ensemble. Takes the test scenes of --data, or simulates --fresh successes:
    hands from the prior that succeed, each with an image of its own scene.

    Args:
        model: Directory of a model; by default the one that comes with the package.
        successes: Which successes are to be found again.
        proposals: Draws from the prior behind every posterior.
        ensemble: Further models, trained with other seeds.
        json: Where the numbers go.
        out: Where the figures go.
        seed: Of all random numbers.
        workers: Processes.
    """
    if (successes.data is None) == (successes.fresh is None):
        raise InvalidConfigurationError("give either --data DIR or --fresh N")
    job = CalibrationJob((model_directory(model), *ensemble), proposals, seed)
    pairs, attempted = successes.pairs(seed, workers)
    with counting("posteriors", len(pairs.images)) as progress:
        report = calibrate(job, pairs, attempted, workers, progress)
    if json is not None:
        write_json(json, report.to_dict())
    print_report(report, () if out is None else report.draw(out))


def print_report(report: Report, figures: Sequence[Path]) -> None:
    """Say what a report found, and where its figures are."""
    content: dict[str, Any] = report.to_dict()
    coverage, tarp, reliable = (content[name] for name in ("expected_coverage", "tarp", "reliability"))
    side = "too wide" if coverage["mean_signed_error"] > 0 else "too narrow"
    print(f"expected coverage: largest error {coverage['max_error']:.3f} over {coverage['count']} successes ({side})")
    for name, ranks in content["sbc"].items():
        print(f"SBC {name}: p = {ranks['p_value']:.3g}, spread {ranks['spread']:.2f}, shift {ranks['shift']:+.3f}")
    print(f"TARP: p = {tarp['p_value']:.3g}, spread {tarp['spread']:.2f}")
    print(f"p(S=1 | i, h): ECE {reliable['ece']:.4f}, Brier {reliable['brier']:.4f}, AUC {reliable['auc']:.4f}")
    if content["ensemble_spread"] is not None:
        print(f"ensemble spread: median {content['ensemble_spread']['quantile_50']:.2f} nats")
    print(f"importance weights: effective sample size {content['effective_sample_size']:.0f} (median)")
    for path in figures:
        print(path)
