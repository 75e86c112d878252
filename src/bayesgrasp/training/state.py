"""The state of a training run in one file, so that a killed run goes on exactly where it was saved.

Everything is in one safetensors file: weights, averaged weights, best weights and the moments of the optimiser as
tensors, the counters as JSON in the header. It is written beside its place and renamed, so that there is always one
whole file. No random state is needed: draws are addressed by step (`train_estimator.py`).
"""

import hashlib
import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

import torch
from torch import Tensor, nn

from bayesgrasp.errors import CheckpointError, clipped
from bayesgrasp.files import parsed_json
from bayesgrasp.plain_data import restored
from bayesgrasp.ratio.tensor_file import load_weights, read_tensors, write_tensors

MODULES = ("estimator", "averaged", "best")


@dataclass
class TrainingState:
    """Counters of a run.

    Attributes:
        fingerprint: Of configuration, objective and data; a state is only resumed by the same run.
        epoch: The epoch in progress.
        step: Steps done in it.
        loss_sum: Sum of the losses of these steps.
        best_epoch: Whose validation loss is the smallest so far; -1 before the first.
        train, validation: Mean losses of the finished epochs.
    """

    fingerprint: str
    epoch: int = 0
    step: int = 0
    loss_sum: float = 0.0
    best_epoch: int = -1
    train: list[float] = field(default_factory=list)
    validation: list[float] = field(default_factory=list)


def save_state(
    path: Path,
    state: TrainingState,
    estimator: nn.Module,
    averaged: nn.Module,
    best: nn.Module,
    optimizer: torch.optim.Optimizer,
) -> None:
    """Write the state atomically."""
    tensors: dict[str, Tensor] = {}
    for prefix, module in zip(MODULES, (estimator, averaged, best), strict=True):
        tensors |= {f"{prefix}.{name}": value for name, value in module.state_dict().items()}
    for index, moments in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{name}": value for name, value in moments.items()}
    counters = json.dumps(asdict(state))
    write_tensors(path, tensors, {"state": counters, "sha256": _digest(tensors, counters)})


def load_state(
    path: Path,
    fingerprint: str,
    estimator: nn.Module,
    averaged: nn.Module,
    best: nn.Module,
    optimizer: torch.optim.Optimizer,
) -> TrainingState:
    """Read a state into the modules and the optimiser.

    Raises:
        CheckpointError: The file is damaged, or belongs to a run with another configuration or another data set.
    """
    tensors, metadata = read_tensors(path)
    try:
        state = restored(TrainingState, parsed_json(metadata["state"]))
    except (KeyError, ValueError) as error:
        raise CheckpointError(f"{path} is not a saved training state: {clipped(error)}") from error
    if metadata.get("sha256") != _digest(tensors, metadata["state"]):
        raise CheckpointError(f"{path} was damaged or altered after it was saved; take it away to train from the start")
    if state.fingerprint != fingerprint:
        raise CheckpointError(
            f"{path} belongs to another run: {_difference(state.fingerprint, fingerprint)}; use the same options and "
            "the same data, or another output directory"
        )
    for prefix, module in zip(MODULES, (estimator, averaged, best), strict=True):
        load_weights(module, _below(tensors, prefix), path)
    _load_moments(optimizer, _below(tensors, "optimizer"))
    return state


def _digest(tensors: dict[str, Tensor], counters: str) -> str:
    """SHA-256 of counters, names and values."""
    found = hashlib.sha256(counters.encode())
    for name in sorted(tensors):
        found.update(name.encode())
        found.update(tensors[name].detach().cpu().contiguous().reshape(-1).view(torch.uint8).numpy().tobytes())
    return found.hexdigest()


def _difference(there: str, here: str) -> str:
    """The first place where two fingerprints differ, in words."""
    same = next((i for i, (a, b) in enumerate(zip(there, here, strict=False)) if a != b), min(len(there), len(here)))
    start = max(there.rfind(",", 0, same), there.rfind("(", 0, same)) + 1
    return f"it was saved with {clipped(there[start:], 60)}, this run has {clipped(here[start:], 60)}"


def _below(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name[len(prefix) + 1 :]: value for name, value in tensors.items() if name.startswith(f"{prefix}.")}


def _load_moments(optimizer: torch.optim.Optimizer, moments: dict[str, Tensor]) -> None:
    saved: dict[int, dict[str, Tensor]] = {}
    for name, value in moments.items():
        index, moment = name.split(".")
        saved.setdefault(int(index), {})[moment] = value
    optimizer.load_state_dict({"state": saved, "param_groups": optimizer.state_dict()["param_groups"]})
