"""The page of a whole experiment, from the files that its stages left in its directory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bayesgrasp.evaluation.report import Picture, Section, write_report
from bayesgrasp.evaluation.tables import markdown, markdown_per_object
from bayesgrasp.files import MIB, read_json

LARGEST = 64 * MIB
"""Bytes of a file of results."""
CALIBRATION = {
    "coverage": "Expected coverage of highest-density regions, and TARP.",
    "sbc": "Simulation-based calibration: ranks of the truths.",
    "tarp": "TARP: ranks of distances from random points.",
    "reliability": "Predicted probability of success against the share of successes.",
}
"""Figures of the calibration, with their captions."""


def write_experiment_page(directory: Path, splits: Sequence[str], attempts: int) -> Path:
    """Write ``report.html``; returns its path.

    Args:
        directory: Of the experiment.
        splits: That were benchmarked.
        attempts: Lift tests that the model was trained on.
    """
    page = directory / "report.html"
    sections = [_success(directory / f"benchmark-{split}", split, attempts) for split in splits]
    write_report(page, "bayesgrasp: results", [*sections, *_posterior(directory)])
    return page


def _success(results: Path, split: str, attempts: int) -> Section:
    summary = read_json(results / "summary.json", LARGEST)
    text = (
        f"{summary['scenes']} scenes, seed {summary['seed']}; model trained on {attempts} lift tests. "
        "Intervals are Wilson's, 95 %; unreachable grasps are failures. The paper's rates are from its own "
        "simulator: compare the ladder, not single rungs."
    )
    pictures = (
        Picture(results / "ladder.png", "Success rates of the strategies."),
        Picture(results / "per_object.png", "Success rates by object."),
    )
    tables = (markdown(summary, split), markdown_per_object(summary))
    return Section(f"Success rates: {split}", (text,), tables, pictures)


def _posterior(directory: Path) -> list[Section]:
    coverage = read_json(directory / "diagnostics.json", LARGEST)["expected_coverage"]
    text = f"Largest error of the expected coverage: {coverage['max_error']:.3f} ({coverage['count']} successes)."
    figures = [Picture(directory / "diagnostics" / f"{name}.png", caption) for name, caption in CALIBRATION.items()]
    return [
        Section("Calibration", (text,), (), figures),
        Section("Posterior", (), (), (Picture(directory / "demo.png", "A scene, its posterior, and the lift."),)),
        Section("Prior", (), (), (Picture(directory / "prior.png", "Draws from the prior of hands."),)),
    ]
