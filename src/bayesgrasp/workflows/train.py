"""From a data set to a model on disk: ``bayesgrasp train``, and the training of ``bayesgrasp reproduce``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.errors import CheckpointError
from bayesgrasp.locks import sole_writer
from bayesgrasp.ratio.card import CARD
from bayesgrasp.ratio.checkpoint import load_model, save_model
from bayesgrasp.ratio.model import POWER, Role
from bayesgrasp.training.losses import LossConfig
from bayesgrasp.training.presets import Part, PresetName, preset
from bayesgrasp.training.train_estimator import TrainConfig
from bayesgrasp.training.train_model import Watch, train_model
from bayesgrasp.workflows.load import trained_prior, usable_device
from bayesgrasp.workflows.training_data import check_hands, familiarity_of, origin_of, setup_of, sources_by_role

STATE = "state"
"""Below the directory of a model: the states of a run, which may go on."""


@dataclass(frozen=True)
class TrainOptions:
    """What is trained, and how.

    Attributes:
        preset: paper (the two networks of the paper) or best (success from local evidence).
        estimators: Which estimators; those of the preset if empty.
        batch_size: Scenes in a batch.
        criterion: Loss of the likelihood-to-evidence ratios.
        schedule: Of the estimators with images; the others take the same with twice the learning rate.
        epochs: Of estimators that take other numbers of passes than the schedule says.
    """

    preset: PresetName = "best"
    estimators: tuple[Role, ...] = ()
    batch_size: int = 16
    criterion: LossConfig = field(default_factory=LossConfig)
    schedule: TrainConfig = field(default_factory=lambda: TrainConfig(patience=5))
    epochs: Mapping[Role, int] = field(default_factory=dict)

    def parts_for(self, dataset: GraspDataset) -> tuple[Part, ...]:
        """The estimators, made to fit a data set."""
        parts = preset(self.preset, setup_of(dataset), self.estimators or None, self.criterion, self.schedule)
        return tuple(
            replace(part, train=replace(part.train, epochs=self.epochs.get(part.role, part.train.epochs)))
            for part in parts
        )


def train(
    data: Path | str,
    out: Path | str,
    options: TrainOptions | None = None,
    *,
    practice: Sequence[Path] = (),
    start: Path | None = None,
    device: str = "cpu",
    resume: bool = False,
    progress: Watch | None = None,
) -> Mapping[str, dict[str, Any]]:
    """Train likelihood-to-evidence ratio estimators on a data set, and write the model.

    A run that was killed goes on with ``resume`` and ends with the weights of an undisturbed run.

    Args:
        data: Directory of a data set.
        out: Directory of the model: a file of weights for each estimator and the card.
        options: What is trained, and how.
        practice: Directories of practice to learn from as well.
        start: Directory of a model of the same preset whose weights training starts from.
        device: cpu, cuda, or cuda:N.
        resume: Go on with the run in ``out``, or start it where there is none.
        progress: Told after every step of which part.

    Returns:
        Losses, schedule, checks and time of each estimator, by role, as the card has them.

    Raises:
        FileError: Another process is writing to ``out``, or the disk is full.
        CheckpointError: There is a run in ``out`` already, or its state is of another run, or ``start`` is no model.
        DataError: There is no data set, or not enough in it, or practice is for another hand.
        InvalidConfigurationError: The device cannot be used.
    """
    out, options = Path(out), options or TrainOptions()
    if not resume and ((out / STATE).exists() or (out / CARD).exists()):
        raise CheckpointError(f"{out} holds a run already: give --resume to go on with it, or another directory")
    dataset, device = GraspDataset(data), str(usable_device(device))
    parts, sets = options.parts_for(dataset), [GraspDataset(directory) for directory in practice]
    check_hands(sets, dataset.manifest.hand)
    sources = sources_by_role(parts, dataset, sets, options.batch_size, options.schedule.seed)
    origin = origin_of(dataset)
    extra: dict[str, Any] = {"preset": options.preset, "familiarity": familiarity_of(dataset)}
    begin = None if start is None else load_model(start, hand=dataset.manifest.hand).estimators
    with sole_writer(out):
        trained = train_model(
            parts,
            sources,
            trained_prior({"prior": origin.prior}),
            start=begin,
            device=device,
            states=out / STATE,
            callback=progress,
        )
        if trained.power:
            extra[POWER] = dict(trained.power)
        save_model(out, trained.estimators, origin, trained.metrics, extra)
    return trained.metrics
