"""The estimators of a preset, trained one after another, each checked on held-out draws.

Data in, model out. Every part keeps its state in a file of its own, so a killed run goes on with the part it was in.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.ratio.kinds import build
from bayesgrasp.ratio.local import LocalSuccess
from bayesgrasp.ratio.model import Role
from bayesgrasp.ratio.tensor_file import load_weights
from bayesgrasp.training.checks import check
from bayesgrasp.training.power import posterior_power
from bayesgrasp.training.presets import Part
from bayesgrasp.training.sources import Sources
from bayesgrasp.training.train_estimator import Progress, Result, train_estimator

Watch = Callable[[Part, Progress], None]
"""Told after every step of which part."""


@dataclass(frozen=True)
class TrainedModel:
    """What training gave, by role.

    Attributes:
        estimators: On the CPU, in evaluation mode.
        metrics: Losses, schedule, checks and time, as JSON-able data.
        power: Of p(S=1 | i, h), fitted on the held-out scenes (`power.py`); empty where it was not trained.
    """

    estimators: Mapping[str, nn.Module]
    metrics: Mapping[str, dict[str, Any]]
    power: Mapping[str, float]


def train_model(
    parts: Sequence[Part],
    sources: Mapping[Role, Sources],
    prior: GraspPrior,
    *,
    start: Mapping[str, nn.Module] | None = None,
    device: torch.device | str = "cpu",
    states: Path | None = None,
    callback: Watch | None = None,
) -> TrainedModel:
    """Train the parts of a model.

    Args:
        parts: Of a preset.
        sources: What each part learns from and is validated on, by role.
        prior: p(h), for the power of p(S=1 | i, h).
        start: Trained estimators by role whose weights a part of the same role and shape starts from.
        device: Where to train.
        states: Directory of the states of the parts; what is there is gone on with. None keeps none.
        callback: Told after every step.

    Raises:
        CheckpointError: A state is of another run, or the weights to start from do not fit.
    """
    estimators: dict[str, nn.Module] = {}
    metrics: dict[str, dict[str, Any]] = {}
    power: dict[str, float] = {}
    for part in parts:
        data = sources[part.role]
        result = _train_part(part, data, (start or {}).get(part.role), device, states, callback)
        estimators[part.role] = result.estimator
        metrics[part.role] = _metrics(part, data, result)
        if part.role == "success":
            power[part.role] = posterior_power(result.estimator, data.held_out.batches(0), prior)
    return TrainedModel(estimators, metrics, power)


def _train_part(
    part: Part,
    sources: Sources,
    start: nn.Module | None,
    device: torch.device | str,
    states: Path | None,
    callback: Watch | None,
) -> Result:
    def begin() -> nn.Module:
        estimator = build(part.kind, part.config)
        if start is not None:
            load_weights(estimator, weights_for(estimator, start), f"the {part.role} estimator to start from")
        return estimator

    return train_estimator(
        begin,
        part.objective,
        sources,
        part.train,
        device=device,
        state_file=None if states is None else states / f"{part.role}.safetensors",
        resume=True,
        callback=None if callback is None else lambda progress: callback(part, progress),
    )


def weights_for(estimator: nn.Module, start: nn.Module) -> dict[str, Tensor]:
    """The weights of a trained estimator; local evidence may be looked up at more points than it did."""
    if isinstance(estimator, LocalSuccess) and isinstance(start, LocalSuccess):
        return estimator.weights_from(start)
    return dict(start.state_dict())


def _metrics(part: Part, sources: Sources, result: Result) -> dict[str, Any]:
    history = {"train_loss": result.train, "validation_loss": result.validation, "best_epoch": result.best_epoch}
    schedule = {"stopped": result.stopped, "seconds": round(result.seconds, 1), "schedule": asdict(part.train)}
    checks = check(result.estimator, part.objective, sources.held_out.batches(0), part.train.seed)
    return {**history, **schedule, "checks": checks}
