"""``bayesgrasp train``: from a data set to a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import torch
import tyro

from bayesgrasp.cli.progress import training
from bayesgrasp.ratio.model import Role
from bayesgrasp.training.losses import Criterion, LossConfig
from bayesgrasp.training.presets import PresetName
from bayesgrasp.training.train_estimator import TrainConfig
from bayesgrasp.workflows.load import model_directory
from bayesgrasp.workflows.train import TrainOptions
from bayesgrasp.workflows.train import train as run


@dataclass(frozen=True)
class Learning:
    """What is learned, and how.

    Attributes:
        preset: paper (the two networks of the paper) or best (success from local evidence).
        estimators: Which estimators; by default success_ratio and image for paper, success_ratio and
            success for best.
        epochs: Passes over the training scenes, at most.
        batch_size: Scenes in a batch.
        learning_rate: Peak of the schedule.
        patience: Epochs without improvement on held-out scenes before stopping; 0 never stops early.
        criterion: Loss of the likelihood-to-evidence ratios.
        bf16: Compute in bfloat16 where it is safe.
        seed: Of the weights, the order of scenes and the pairings.
    """

    preset: PresetName = "best"
    estimators: tuple[Role, ...] = ()
    epochs: int = 20
    batch_size: int = 16
    learning_rate: float = 1e-3
    patience: int = 5
    criterion: Criterion = "nre-a"
    bf16: bool = True
    seed: int = 0

    def options(self) -> TrainOptions:
        """The same for the workflow."""
        schedule = TrainConfig(
            epochs=self.epochs,
            learning_rate=self.learning_rate,
            patience=self.patience,
            bf16=self.bf16,
            seed=self.seed,
        )
        return TrainOptions(self.preset, self.estimators, self.batch_size, LossConfig(self.criterion), schedule)


def train(
    data: Path,
    out: Path,
    practice: tuple[Path, ...] = (),
    start: Path | None = None,
    learning: Annotated[Learning, tyro.conf.OmitArgPrefixes] = Learning(),
    device: str = "cpu",
    threads: int | None = None,
    resume: bool = False,
) -> None:
    """Train likelihood-to-evidence ratio estimators on a data set.

    A run that was killed goes on with --resume and ends with the weights of an undisturbed run. The model is written to
    --out: one file of weights per estimator and card.json, with losses and checks. Training curves for TensorBoard are
    written to --out/logs where the package `tensorboard` is installed.

    Args:
        data: Directory of a data set, from `bayesgrasp generate`.
        out: Directory of the model.
        practice: Data sets from `bayesgrasp practice` to learn from as well.
        start: Directory of a model of the same preset whose weights training starts from.
        learning: What is learned, and how.
        device: cpu, cuda, or cuda:N.
        threads: CPU threads; by default torch's own choice.
        resume: Go on with the run in --out, or start it where there is none.
    """
    if threads is not None:
        torch.set_num_threads(threads)
    with training(out) as progress:
        metrics = run(
            data,
            out,
            learning.options(),
            practice=practice,
            start=None if start is None else model_directory(start),
            device=device,
            resume=resume,
            progress=progress,
        )
    print_training(metrics, out)


def print_training(metrics: Mapping[str, dict[str, Any]], out: Path) -> None:
    """Losses and checks of every estimator."""
    for role, values in metrics.items():
        best = values["validation_loss"][values["best_epoch"]]
        checks = ", ".join(f"{name} {value:.4g}" for name, value in values["checks"].items())
        print(f"{role}: held-out loss {best:.4f} (epoch {values['best_epoch'] + 1}), {values['seconds']} s; {checks}")
    print(f"model written to {out}")
