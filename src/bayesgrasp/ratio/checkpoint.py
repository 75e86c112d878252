"""Models on disk: one safetensors file per estimator and a card, `card.json`, that says what they are (`card.py`).

Loading runs no code from the files and refuses a model of another schema, gripper or camera, since such a model gives
plausible and wrong grasps; and one that is not, to the last bit, what was written.
"""

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import nn
from torch.overrides import TorchFunctionMode

from bayesgrasp.errors import CheckpointError
from bayesgrasp.files import make_directory
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.ratio.card import SCHEMA, check_card, promising_weights, read_card, write_card
from bayesgrasp.ratio.kinds import KINDS, build, config_from_dict, config_to_dict
from bayesgrasp.ratio.model import POWER, ROLES, GraspModel
from bayesgrasp.ratio.tensor_file import (
    check_values,
    load_weights,
    parse_tensors,
    read_weights,
    write_tensors,
)
from bayesgrasp.types import UNSTATED_HAND, HandIdentity

SAME = ("gripper", "gripper_sha256", "camera", "prior", "objects")
"""What models must share to be joined."""
STATED = ("gripper", "gripper_sha256", "data", "commit", "success_rate", "cameras")
"""What an origin says in a card as it is."""
ROOM = 1_000_000
"""So many weights may be made for nothing, so that a small mismatch is told by the name of the weights."""


@dataclass(frozen=True)
class Origin:
    """Where a model comes from, and for what it is valid.

    Attributes:
        gripper: Name of the gripper.
        camera: The canonical camera that images are brought to.
        prior: The prior over hands, as plain data.
        data: Fingerprint of the training data.
        commit: Of the code that trained it; None if unknown.
        success_rate: p(S=1) under the prior, in the training data; None if unknown.
        objects: Names of the training meshes, in the order of their index.
        cameras: Where the training images were taken from, canonical or any.
        gripper_sha256: Of the gripper's description.
    """

    gripper: str
    camera: Camera = field(default_factory=canonical_camera)
    prior: Mapping[str, Any] = field(default_factory=dict)
    data: str | None = None
    commit: str | None = None
    success_rate: float | None = None
    objects: tuple[str, ...] = ()
    cameras: str = "canonical"
    gripper_sha256: str = UNSTATED_HAND

    def to_dict(self) -> dict[str, Any]:
        """As the content of a card."""
        content = {name: getattr(self, name) for name in STATED}
        return content | {"camera": self.camera.to_dict(), "prior": dict(self.prior), "objects": list(self.objects)}


def save_model(
    directory: Path,
    estimators: Mapping[str, nn.Module],
    origin: Origin,
    metrics: Mapping[str, Mapping[str, Any]] | None = None,
    extra: Mapping[str, Any] | None = None,
) -> None:
    """Write estimators by role, then the card; without a card a directory is not a model.

    Args:
        directory: Where to; made if it is not there.
        estimators: By role.
        origin: Where they come from.
        metrics: By role, for the card.
        extra: More entries of the card.

    Raises:
        CheckpointError: An estimator of unknown role or kind.
    """
    make_directory(directory)
    entries: dict[str, Any] = {}
    for role, estimator in estimators.items():
        if role not in ROLES:
            raise CheckpointError(f"there is no role {role!r} in a model; choose from {', '.join(ROLES)}")
        entries[role] = {
            "kind": kind_of(estimator),
            "config": config_to_dict(estimator.config),
            "sha256": _write_weights(directory, role, estimator),
            "metrics": dict((metrics or {}).get(role, {})),
        }
    write_card(directory, {"schema": SCHEMA, **origin.to_dict(), "estimators": entries, **(extra or {})})


def load_model(directory: Path, *, hand: HandIdentity | None = None, camera: Camera | None = None) -> GraspModel:
    """Read a model for use with a hand and a canonical camera.

    Args:
        directory: Where `save_model` wrote it.
        hand: The hand that will be used; of any hand if None.
        camera: The camera that images are brought to; `canonical_camera()` if None.

    Raises:
        CheckpointError: Missing, damaged, or made for another schema, gripper or camera.
    """
    card = read_card(directory)
    check_card(card, directory, hand, canonical_camera() if camera is None else camera)
    estimators: dict[str, nn.Module] = {}
    for role, entry in card["estimators"].items():
        estimators[role] = _load_estimator(directory / f"{role}.safetensors", entry)
    return GraspModel(estimators, card)


def join_models(directories: Sequence[Path], out: Path) -> None:
    """Write one model with the estimators of several, each from the last one that has it.

    Args:
        directories: Of models for the same gripper, camera, prior and objects.
        out: Where to; the rest of its card is that of the last model.

    Raises:
        CheckpointError: A model is missing or damaged, or was made for something else than the others.
    """
    models = {directory: load_model(directory) for directory in directories}
    joined: dict[str, Any] = {"estimators": {}}
    estimators: dict[str, nn.Module] = {}
    for directory, model in models.items():
        differing = [name for name in SAME if name in joined and joined[name] != model.card.get(name)]
        if differing:
            raise CheckpointError(
                f"the model {directory} cannot be joined with the others: {', '.join(differing)} differ"
            )
        # What was fitted to an estimator, such as its power, goes with it.
        fitted = {**joined.get(POWER, {}), **model.card.get(POWER, {})}
        joined = {**model.card, "estimators": {**joined["estimators"], **model.card["estimators"]}, POWER: fitted}
        estimators |= model.estimators
    joined["estimators"] = save_estimators(out, estimators, joined["estimators"])
    if "delivery" in joined and tuple(joined["delivery"]["weights"]) != promising_weights(joined):
        del joined["delivery"]  # of other weights than are joined here
    write_card(out, joined)


def save_estimators(
    directory: Path, estimators: Mapping[str, nn.Module], entries: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Write weights for a card that has their entries already; returns the entries with the new checksums."""
    make_directory(directory)
    return {role: {**entries[role], "sha256": _write_weights(directory, role, e)} for role, e in estimators.items()}


def kind_of(estimator: nn.Module) -> str:
    """Name of the estimator's architecture.

    Raises:
        CheckpointError: It is not one of ours.
    """
    for name, kind in KINDS.items():
        if type(estimator) is kind.module:
            return name
    raise CheckpointError(f"{type(estimator).__name__} is no estimator that can be saved; known: {', '.join(KINDS)}")


class _AtMost(TorchFunctionMode):
    """Refuses to make far more weights than a file holds before they take memory: its card may ask for any number."""

    def __init__(self, count: int, path: Path) -> None:
        super().__init__()
        self.left, self.path = count, path

    def __torch_function__(
        self, func: Callable[..., Any], types: Any, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        if func is torch.empty:  # what every layer's weights begin as
            self.left -= math.prod(args[0] if isinstance(args[0], tuple) else args)
        if self.left < 0:
            raise CheckpointError(f"the weights {self.path} are fewer than the configuration on the card asks for")
        return func(*args, **(kwargs or {}))


def _write_weights(directory: Path, role: str, estimator: nn.Module) -> str:
    """Write an estimator's weights and return their checksum."""
    path = directory / f"{role}.safetensors"
    tensors = estimator.state_dict()
    check_values(tensors, path)
    return write_tensors(path, tensors, {"role": role})


def _load_estimator(path: Path, entry: Mapping[str, Any]) -> nn.Module:
    config = config_from_dict(entry["kind"], entry["config"])
    content = read_weights(path)
    if hashlib.sha256(content).hexdigest() != entry["sha256"]:
        raise CheckpointError(
            f"the weights {path} are not the ones of the card: they were damaged or altered, their checksum differs"
        )
    tensors, _ = parse_tensors(content, path)
    # The first weights are random, then replaced.
    known = sum(tensor.numel() for tensor in tensors.values())
    with torch.random.fork_rng(devices=[]), _AtMost(2 * known + ROOM, path):
        estimator = build(entry["kind"], config)
    load_weights(estimator, tensors, path)
    return estimator.eval().requires_grad_(False)
