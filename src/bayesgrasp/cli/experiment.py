"""The experiment behind ``bayesgrasp reproduce``: its stages as functions."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from bayesgrasp.cli.scales import Scale
from bayesgrasp.ratio.model import Role

if TYPE_CHECKING:
    from bayesgrasp.evaluation.report import Section


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
            **self._rounds(),
            "model": self.join,
            "diagnostics": self.diagnose,
            **judged,
            "figures": self.draw,
            "report": self.report,
        }

    def _rounds(self) -> dict[str, Callable[[], None]]:
        stages: dict[str, Callable[[], None]] = {}
        for number in range(1, len(self.scale.rounds) + 1):
            stages[f"practice {number}"] = partial(self.practise, number)
            stages[f"training {number}"] = partial(self.train_further, number)
        return stages

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
            proposal=self.scale.proposal,
            attempts_per_draw=self.scale.attempts_per_draw,
            scenes_per_draw=self.scale.scenes_per_draw,
        )

    def train(self) -> None:
        """The estimators, each with a schedule of its own."""
        scale = self.scale
        self._fit(self._model(0), scale.estimators, scale.epochs, scale.learning_rate)

    def practise(self, number: int) -> None:
        """Lift tests of the proposals of the model before a round, counted from 1."""
        from bayesgrasp.cli.practice import practice

        one = self.scale.rounds[number - 1]
        practice(
            self._latest(one.estimator, number),
            self._practice(number),
            scenes=one.scenes,
            seed=self.seed + number,
            workers=self.workers,
            resume=True,
            split=self.scale.split,
            ycb_dir=self.ycb_dir,
            copies=one.copies,
            estimator=one.estimator,
        )

    def train_further(self, number: int) -> None:
        """The estimator of a round, from where it was, with all practice so far."""
        one = self.scale.rounds[number - 1]
        practised = [self._practice(n + 1) for n in range(number)]
        before = self._latest(one.estimator, number)
        epochs: dict[Role, int] = {one.estimator: one.epochs}
        self._fit(self._model(number), (one.estimator,), epochs, one.learning_rate, practised, before)

    def join(self) -> None:
        """The last version of every estimator as one model."""
        from bayesgrasp.ratio.checkpoint import join_models

        join_models([self._model(number) for number in range(len(self.scale.rounds) + 1)], self.out / "model")

    def _model(self, number: int) -> Path:
        return self.out / f"model-{number}"

    def _practice(self, number: int) -> Path:
        return self.out / f"practice-{number}"

    def _latest(self, estimator: Role, number: int) -> Path:
        """The model with the last version of an estimator before a round."""
        earlier = [n + 1 for n in range(number - 1) if self.scale.rounds[n].estimator == estimator]
        return self._model(max(earlier, default=0))

    def _fit(
        self,
        out: Path,
        estimators: tuple[Role, ...],
        epochs: Mapping[Role, int],
        learning_rate: float,
        practised: Sequence[Path] = (),
        start: Path | None = None,
    ) -> None:
        from bayesgrasp.cli import training
        from bayesgrasp.cli.training_view import observers, print_summary
        from bayesgrasp.data.loader import GraspDataset
        from bayesgrasp.ratio.checkpoint import load_model
        from bayesgrasp.training.presets import preset
        from bayesgrasp.training.train_estimator import TrainConfig
        from bayesgrasp.training.train_model import fit
        from bayesgrasp.workflows.load import trained_prior

        dataset = GraspDataset(self.out / "data")
        schedule = TrainConfig(learning_rate=learning_rate, patience=5, seed=self.seed)
        parts = [
            replace(part, train=replace(part.train, epochs=epochs[part.role]))
            for part in preset(self.scale.preset, training.setup_of(dataset), estimators, train=schedule)
        ]
        sets = [GraspDataset(directory) for directory in practised]
        with observers(out, len(parts)) as observe:
            metrics = fit(
                parts,
                training.sources_by_part(dataset, sets, self.scale.batch_size, self.seed),
                out,
                training.origin_of(dataset),
                start=load_model(start).estimators if start is not None else None,
                device=training.usable_device(self.device),
                resume=True,
                callback=observe,
                prior=trained_prior({"prior": training.prior_of(dataset)}),
                extra={"preset": self.scale.preset, "familiarity": training.familiarity_of(dataset)},
            )
        print_summary(metrics, out)

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
        from bayesgrasp.cli.demo import demo
        from bayesgrasp.evaluation.figures import plot_prior
        from bayesgrasp.ratio.checkpoint import read_card
        from bayesgrasp.seeding import Stream, generator
        from bayesgrasp.workflows.load import trained_prior

        plot_prior(
            trained_prior(read_card(self.out / "model")),
            self.out / "prior.png",
            generator(self.seed, Stream.PRIOR_FIGURE),
        )
        demo(self.scale.demo, self.seed + 1, self.out / "demo.png", self.out / "model", self.ycb_dir)

    def report(self) -> None:
        """The page."""
        from bayesgrasp.evaluation.report import write_report

        sections = [self._success(split) for split in self.scale.judged]
        write_report(self.out / "report.html", "bayesgrasp: results", [*sections, *self._posterior()])

    def _success(self, split: str) -> Section:
        from bayesgrasp.evaluation.report import Picture, Section
        from bayesgrasp.evaluation.tables import markdown, markdown_per_object

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
        from bayesgrasp.evaluation.report import Picture, Section

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
