"""The whole experiment in stages, from simulations to one page of results: ``bayesgrasp reproduce``.

    data, training, {practice k, training k}, model, diagnostics, {benchmark of a split}, figures, report

A stage that is finished is not repeated, and one that was interrupted goes on where it was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.evaluation.demonstration import demonstrate
from bayesgrasp.evaluation.experiment_page import write_experiment_page
from bayesgrasp.evaluation.figures import plot_prior
from bayesgrasp.files import write_json
from bayesgrasp.generation.chunks import GenerateConfig
from bayesgrasp.generation.pool import LocalPool
from bayesgrasp.locks import sole_writer
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.prior.cameras import camera_law
from bayesgrasp.ratio.card import read_card
from bayesgrasp.ratio.checkpoint import join_models
from bayesgrasp.ratio.model import Role
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.training.mix import mix
from bayesgrasp.training.train_estimator import TrainConfig
from bayesgrasp.viewer.story import draw_story
from bayesgrasp.workflows.calibrate import CalibrationJob, calibrate
from bayesgrasp.workflows.evaluate import Evaluation
from bayesgrasp.workflows.generate import GenerateJob, generate
from bayesgrasp.workflows.load import load_planner, model_directory, trained_prior
from bayesgrasp.workflows.practise import PracticeJob, practise
from bayesgrasp.workflows.scales import SCALES, Scale, ScaleName
from bayesgrasp.workflows.stages import Stages, Watcher
from bayesgrasp.workflows.success_pairs import stored_pairs
from bayesgrasp.workflows.train import TrainOptions, train


def reproduce(
    out: Path,
    scale: ScaleName = "paper",
    *,
    seed: int = 0,
    workers: int = 1,
    device: str = "cpu",
    ycb_dir: Path | None = None,
    watcher: Watcher | None = None,
) -> Path:
    """Run the whole experiment, or go on with it; returns its page.

    Args:
        out: Directory of the experiment.
        scale: small (minutes, household stand-ins only), paper (hours, needs the YCB scans) or general (the same, also
            procedural objects and cameras anywhere).
        seed: Of all random numbers; the benchmark uses the next one.
        workers: Processes.
        device: Where to train: cpu, cuda, or cuda:N.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        watcher: Told what goes on.

    Raises:
        InvalidConfigurationError: The directory holds another experiment.
        FileError: Another process is writing to it.
    """
    watcher = watcher or Watcher()
    experiment = Experiment(out, SCALES[scale], seed, workers, device, ycb_dir, watcher)
    with sole_writer(out):
        stages = Stages(out, {"scale": scale, "settings": asdict(SCALES[scale]), "seed": seed})
        for name, work in experiment.stages().items():
            stages.run(name, work, watcher)
    return out / "report.html"


@dataclass(frozen=True)
class Experiment:
    """The stages, each a workflow of its own.

    Attributes:
        out: Directory of the experiment.
        scale: How large it is.
        seed, workers, device, ycb_dir, watcher: See `reproduce`.
    """

    out: Path
    scale: Scale
    seed: int = 0
    workers: int = 1
    device: str = "cpu"
    ycb_dir: Path | None = None
    watcher: Watcher = field(default_factory=Watcher)

    def stages(self) -> dict[str, Callable[[], None]]:
        """By name, in order."""
        stages: dict[str, Callable[[], None]] = {"data": self.generate}
        if self.scale.start is None:
            stages["training"] = self.train
        for number in range(1, len(self.scale.rounds) + 1):
            stages[f"practice {number}"] = partial(self.practise, number)
            if self.scale.rounds[number - 1].epochs:
                stages[f"training {number}"] = partial(self.train_further, number)
        stages |= {"model": self.join, "diagnostics": self.calibrate}
        stages |= {f"benchmark {split}": partial(self.evaluate, split) for split in self.scale.judged}
        return stages | {"figures": self.draw, "report": self.write_page}

    def generate(self) -> None:
        """Lift tests and images."""
        scale, out = self.scale, self.out / "data"
        config = GenerateConfig(
            proposal=scale.proposal,
            attempts_per_draw=scale.attempts_per_draw,
            scenes_per_draw=scale.scenes_per_draw,
            draws_per_chunk=scale.draws_per_chunk,
            camera=camera_law(scale.cameras),
        )
        job = GenerateJob(self._objects(scale.split), scale.attempts, config, self.seed)
        with self.watcher.generating(scale.attempts) as progress:
            manifest = generate(job, out, LocalPool(self.workers), resume=True, progress=progress)
        self.watcher.generated(manifest, out)

    def train(self) -> None:
        """The estimators, each with a schedule of its own."""
        scale = self.scale
        self._train(self._model(0), scale.estimators, scale.epochs, scale.learning_rate)

    def practise(self, number: int) -> None:
        """Lift tests of the proposals of the model before a round, counted from 1."""
        one, out = self.scale.rounds[number - 1], self._practice(number)
        job = PracticeJob(
            self.latest(one.estimator, number),
            self._objects(one.split or self.scale.split),
            scenes=one.scenes,
            estimator=one.estimator,
            deform=one.deform,
            cameras=self.scale.cameras,
            seed=self.seed + number,
            explore=one.explore,
        )
        with self.watcher.generating(job.attempts) as progress:
            manifest = practise(job, out, self.workers, resume=True, progress=progress)
        self.watcher.generated(manifest, out)

    def train_further(self, number: int) -> None:
        """The estimator of a round, from where it was, with all practice so far."""
        one = self.scale.rounds[number - 1]
        practice = [self._practice(n + 1) for n in range(number)]
        start = self.latest(one.estimator, number)
        epochs: dict[Role, int] = {one.estimator: one.epochs}
        self._train(self._model(number), (one.estimator,), epochs, one.learning_rate, practice, start)

    def join(self) -> None:
        """The last version of every estimator as one model, mixed with the one that it started from."""
        trained = [self._model(n + 1) for n, one in enumerate(self.scale.rounds) if one.epochs]
        if self.scale.start is None:
            join_models([self._model(0), *trained], self.out / "model")
        else:
            join_models(trained, self.out / "model-further")
            mix(self.out / "model-further", model_directory(self.scale.start), self.scale.kept, self.out / "model")

    def calibrate(self) -> None:
        """Calibration on the test scenes."""
        job = CalibrationJob((self.out / "model",), self.scale.proposals, self.seed)
        rng = generator(self.seed, Stream.DIAGNOSED_PAIR)
        pairs, attempted = stored_pairs(GraspDataset(self.out / "data"), "test", self.scale.truths, rng)
        with self.watcher.calibrating(len(pairs.images)) as progress:
            report = calibrate(job, pairs, attempted, self.workers, progress)
        write_json(self.out / "diagnostics.json", report.to_dict())
        self.watcher.calibrated(report, report.draw(self.out / "diagnostics"))

    def evaluate(self, split: str) -> None:
        """The benchmark on the objects of a split."""
        out = self.out / f"benchmark-{split}"
        evaluation = Evaluation.of(self.out / "model", self._objects(split), split, seed=self.seed + 1)
        with self.watcher.evaluating(evaluation, self.scale.scenes) as progress:
            results = evaluation.run(self.scale.scenes, self.workers, out, resume=True, progress=progress)
        self.watcher.evaluated(evaluation.write(results, out), out)

    def draw(self) -> None:
        """The figures of prior and posterior."""
        rng, picture = generator(self.seed, Stream.PRIOR_FIGURE), self.out / "demo.png"
        plot_prior(trained_prior(read_card(self.out / "model")), self.out / "prior.png", rng)
        planner = load_planner(self.out / "model")
        shown = demonstrate(planner, self._objects(self.scale.demo)[0], self.seed + 1)
        draw_story(picture, planner, shown)
        self.watcher.shown(shown, picture)

    def write_page(self) -> None:
        """The page."""
        write_experiment_page(self.out, self.scale.judged, self.scale.attempts)

    def latest(self, estimator: Role, number: int) -> Path:
        """The model with the last version of an estimator before a round, counted from 1."""
        earlier = [
            n + 1 for n, one in enumerate(self.scale.rounds[: number - 1]) if one.epochs and one.estimator == estimator
        ]
        if not earlier and self.scale.start is not None:
            return model_directory(self.scale.start)
        return self._model(max(earlier, default=0))

    def _model(self, number: int) -> Path:
        return self.out / f"model-{number}"

    def _practice(self, number: int) -> Path:
        return self.out / f"practice-{number}"

    def _objects(self, split: str) -> tuple[ObjectAsset, ...]:
        return load_objects(split, self.ycb_dir)

    def _train(
        self,
        out: Path,
        estimators: tuple[Role, ...],
        epochs: Mapping[Role, int],
        learning_rate: float,
        practice: Sequence[Path] = (),
        start: Path | None = None,
    ) -> None:
        schedule = TrainConfig(learning_rate=learning_rate, patience=5, seed=self.seed)
        options = TrainOptions(
            self.scale.preset, estimators, self.scale.batch_size, schedule=schedule, epochs=dict(epochs)
        )
        with self.watcher.training(out) as progress:
            metrics = train(
                self.out / "data",
                out,
                options,
                practice=practice,
                start=start,
                device=self.device,
                resume=True,
                progress=progress,
            )
        self.watcher.trained(metrics, out)
