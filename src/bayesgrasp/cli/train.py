"""``bayesgrasp train``: from a data set to a model."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from bayesgrasp.ratio.model import Role


def train(
    data: Path,
    out: Path,
    preset: Literal["paper", "best"] = "best",
    estimators: tuple[Role, ...] = (),
    epochs: int = 20,
    batch_size: int = 16,
    learning_rate: float = 1e-3,
    patience: int = 5,
    criterion: Literal["nre-a", "balanced", "nre-c"] = "nre-a",
    bf16: bool = True,
    seed: int = 0,
    device: str = "cpu",
    threads: int | None = None,
    resume: bool = False,
    practice: tuple[Path, ...] = (),
    start: Path | None = None,
) -> None:
    """Train likelihood-to-evidence ratio estimators on a data set.

    A run that was killed goes on with --resume and ends with the weights of an undisturbed run. The model is written to
    --out: one file of weights per estimator and card.json, with losses and checks. Training curves for TensorBoard are
    written to --out/logs where the package `tensorboard` is installed.

    Args:
        data: Directory of a data set, from `bayesgrasp generate`.
        out: Directory of the model.
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
        device: cpu, cuda, or cuda:N.
        threads: CPU threads; by default torch's own choice.
        resume: Go on with the run in --out, or start it where there is none.
        practice: Data sets from `bayesgrasp practice` to learn from as well.
        start: Directory of a model of the same preset whose weights training starts from.
    """
    import torch

    from bayesgrasp.cli import training
    from bayesgrasp.cli.training_view import observers, print_summary
    from bayesgrasp.data.loader import GraspDataset
    from bayesgrasp.ratio.checkpoint import load_model
    from bayesgrasp.training.losses import LossConfig
    from bayesgrasp.training.presets import preset as parts_of
    from bayesgrasp.training.train_estimator import TrainConfig
    from bayesgrasp.training.train_model import fit
    from bayesgrasp.workflows.load import trained_prior

    if threads is not None:
        torch.set_num_threads(threads)
    dataset = GraspDataset(data)
    schedule = TrainConfig(epochs=epochs, learning_rate=learning_rate, patience=patience, bf16=bf16, seed=seed)
    parts = parts_of(preset, training.setup_of(dataset), estimators or None, LossConfig(criterion), schedule)
    with observers(out, len(parts)) as observe:
        metrics = fit(
            parts,
            training.sources_by_part(dataset, [GraspDataset(p) for p in practice], batch_size, seed),
            out,
            training.origin_of(dataset),
            start=load_model(start).estimators if start is not None else None,
            device=training.usable_device(device),
            resume=resume,
            callback=observe,
            prior=trained_prior({"prior": training.prior_of(dataset)}),
            extra={"preset": preset, "familiarity": training.familiarity_of(dataset)},
        )
    print_summary(metrics, out)
