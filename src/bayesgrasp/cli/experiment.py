"""The experiment behind ``bayesgrasp reproduce``: its two scales, and its stages as functions."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from bayesgrasp.benchmark.report import Section
    from bayesgrasp.ratio.presets import Part, Setup

    Estimator = Literal["metric", "image", "joint", "success", "full"]


@dataclass(frozen=True)
class Scale:
    """How large an experiment is.

    Attributes:
        split: Training objects.
        attempts: Lift tests of the data set.
        attempts_per_draw: See `bayesgrasp generate`.
        preset, estimators, batch_size, learning_rate: See `bayesgrasp train`.
        epochs: Passes over the training scenes of each estimator; those without an image cost little and need many.
        truths, proposals: See `bayesgrasp diagnose`.
        scenes: Of each benchmark.
        judged: Splits that are benchmarked.
        demo: The object of the posterior figure.
    """

    split: str
    attempts: int
    attempts_per_draw: int
    preset: Literal["paper", "best"]
    estimators: tuple[Estimator, ...]
    epochs: dict[str, int]
    batch_size: int
    learning_rate: float
    truths: int
    proposals: int
    scenes: int
    judged: tuple[str, ...]
    demo: str = "household_carton"


SCALES: dict[str, Scale] = {
    "small": Scale(
        split="stand-ins",
        attempts=32_768,
        attempts_per_draw=64,
        preset="best",
        estimators=("metric", "success", "full"),
        epochs={"metric": 15, "success": 3, "full": 30},
        batch_size=8,
        learning_rate=2e-3,
        truths=60,
        proposals=1500,
        scenes=60,
        judged=("stand-ins",),
    ),
    "full": Scale(
        split="train",
        attempts=3_000_000,
        attempts_per_draw=128,
        preset="best",
        estimators=("metric", "success", "full"),
        epochs={"metric": 40, "success": 20, "full": 60},
        batch_size=16,
        learning_rate=1e-3,
        truths=1000,
        proposals=10_000,
        scenes=1000,
        judged=("train", "train-ycb", "unseen"),
    ),
}


@dataclass(frozen=True)
class Experiment:
    """The stages, each a command of its own.

    Attributes:
        out: Directory of the experiment.
        scale: How large it is.
        seed, workers, device, ycb_dir: See `reproduce`.
    """

    out: Path
    scale: Scale
    seed: int
    workers: int
    device: str
    ycb_dir: Path | None

    def stages(self) -> dict[str, Callable[[], None]]:
        """By name, in order."""
        judged = {f"benchmark {split}": self._judge(split) for split in self.scale.judged}
        return {
            "data": self.simulate,
            "training": self.train,
            "diagnostics": self.diagnose,
            **judged,
            "figures": self.draw,
            "report": self.report,
        }

    def simulate(self) -> None:
        """Lift tests and images."""
        from bayesgrasp.cli.generate import generate

        generate(
            self.scale.attempts,
            self.out / "data",
            seed=self.seed,
            workers=self.workers,
            resume=True,
            split=self.scale.split,
            ycb_dir=self.ycb_dir,
            proposal="adaptive",
            attempts_per_draw=self.scale.attempts_per_draw,
            scenes_per_draw=2,
        )

    def train(self) -> None:
        """The estimators, each with a schedule of its own."""
        from bayesgrasp.cli import training
        from bayesgrasp.cli.loading import trained_prior
        from bayesgrasp.cli.training_view import observers, print_summary
        from bayesgrasp.data.loader import GraspDataset
        from bayesgrasp.ratio.fit import fit

        dataset = GraspDataset(self.out / "data")
        parts = self._parts(training.setup_of(dataset))
        with observers(self.out / "model", len(parts)) as observe:
            metrics = fit(
                parts,
                training.sources_by_part(dataset, (), self.scale.batch_size, self.seed),
                self.out / "model",
                training.origin_of(dataset),
                device=training.usable_device(self.device),
                resume=True,
                callback=observe,
                prior=trained_prior({"prior": training.prior_of(dataset)}),
                extra={"preset": self.scale.preset, "familiarity": training.familiarity_of(dataset)},
            )
        print_summary(metrics, self.out / "model")

    def _parts(self, setup: Setup) -> tuple[Part, ...]:
        from bayesgrasp.ratio.presets import preset
        from bayesgrasp.ratio.train import TrainConfig

        scale = self.scale
        schedule = TrainConfig(learning_rate=scale.learning_rate, patience=5, seed=self.seed)
        parts = preset(scale.preset, setup, scale.estimators, train=schedule)
        return tuple(replace(part, train=replace(part.train, epochs=scale.epochs[part.role])) for part in parts)

    def diagnose(self) -> None:
        """Calibration on the test scenes."""
        from bayesgrasp.cli.diagnose import diagnose

        diagnose(
            self.out / "model",
            self.out / "data",
            truths=self.scale.truths,
            proposals=self.scale.proposals,
            json=self.out / "diagnostics.json",
            out=self.out / "diagnostics",
            seed=self.seed,
        )

    def _judge(self, split: str) -> Callable[[], None]:
        from bayesgrasp.cli.benchmark import benchmark

        return lambda: benchmark(
            self.out / "model",
            attempts=self.scale.scenes,
            split=split,
            ycb_dir=self.ycb_dir,
            seed=self.seed + 1,
            workers=self.workers,
            out=self.out / f"benchmark-{split}",
            resume=True,
        )

    def draw(self) -> None:
        """The figures of prior and posterior."""
        from bayesgrasp.benchmark.figures import plot_prior
        from bayesgrasp.cli.demo import demo
        from bayesgrasp.cli.loading import trained_prior
        from bayesgrasp.ratio.checkpoint import read_card
        from bayesgrasp.seeding import generator

        plot_prior(trained_prior(read_card(self.out / "model")), self.out / "prior.png", generator(self.seed))
        demo(self.scale.demo, self.seed + 1, self.out / "demo.png", self.out / "model", self.ycb_dir)

    def report(self) -> None:
        """The page."""
        from bayesgrasp.benchmark.report import write_report

        sections = [self._success(split) for split in self.scale.judged]
        write_report(self.out / "report.html", "bayesgrasp: results", [*sections, *self._posterior()])

    def _success(self, split: str) -> Section:
        from bayesgrasp.benchmark.report import Picture, Section
        from bayesgrasp.benchmark.tables import markdown, markdown_per_object

        results = self.out / f"benchmark-{split}"
        summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
        text = (
            f"{summary['scenes']} scenes, seed {summary['seed']}; model trained on {self.scale.attempts} lift tests. "
            "Intervals are Wilson's, 95 %; unreachable grasps are failures. The paper's rates are from its own "
            "simulator: compare the ladder, not single rungs."
        )
        pictures = (
            Picture(results / "ladder.png", "Success rates of the strategies."),
            Picture(results / "per_object.png", "Success rates by object."),
        )
        tables = (markdown(summary, split), markdown_per_object(summary))
        return Section(f"Success rates: {split}", (text,), tables, pictures)

    def _posterior(self) -> list[Section]:
        from bayesgrasp.benchmark.report import Picture, Section

        diagnostics = self.out / "diagnostics"
        coverage = json.loads((self.out / "diagnostics.json").read_text(encoding="utf-8"))["expected_coverage"]
        text = f"Largest error of the expected coverage: {coverage['max_error']:.3f} ({coverage['count']} successes)."
        captions = {
            "coverage": "Expected coverage of highest-density regions, and TARP.",
            "sbc": "Simulation-based calibration: ranks of the truths.",
            "tarp": "TARP: ranks of distances from random points.",
            "reliability": "Predicted probability of success against the share of successes.",
        }
        calibration = [Picture(diagnostics / f"{name}.png", caption) for name, caption in captions.items()]
        return [
            Section("Calibration", (text,), (), calibration),
            Section("Posterior", (), (), (Picture(self.out / "demo.png", "A scene, its posterior, and the lift."),)),
            Section("Prior", (), (), (Picture(self.out / "prior.png", "Draws from the prior of hands."),)),
        ]
