"""Models on disk: one safetensors file per estimator and a card, `card.json`, that says what they are.

The card names the schema, the gripper, the camera, the prior, the data and the commit that the estimators came from,
their kinds, configurations, checksums and metrics. Loading runs no code from the files and refuses a model of another
schema, gripper or camera, since such a model gives plausible and wrong grasps.
"""

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from bayesgrasp.errors import CheckpointError
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.ratio.kinds import KINDS, build, config_from_dict, config_to_dict
from bayesgrasp.ratio.model import POWER, ROLES, GraspModel
from bayesgrasp.ratio.tensor_file import load_weights, read_tensors, write_tensors

SCHEMA = 1
CARD = "card.json"
GRIPPER = "robotiq-3f"
SAME = ("gripper", "camera", "prior", "objects")
"""What models must share to be joined."""


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
    """

    gripper: str = GRIPPER
    camera: Camera = field(default_factory=canonical_camera)
    prior: Mapping[str, Any] = field(default_factory=dict)
    data: str | None = None
    commit: str | None = None
    success_rate: float | None = None
    objects: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """As the content of a card."""
        content = {name: getattr(self, name) for name in ("gripper", "data", "commit", "success_rate")}
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
    directory.mkdir(parents=True, exist_ok=True)
    entries: dict[str, Any] = {}
    for role, estimator in estimators.items():
        if role not in ROLES:
            raise CheckpointError(f"there is no role {role!r} in a model; choose from {', '.join(ROLES)}")
        path = directory / f"{role}.safetensors"
        write_tensors(path, estimator.state_dict(), {"role": role})
        entries[role] = {
            "kind": kind_of(estimator),
            "config": config_to_dict(estimator.config),
            "sha256": _digest(path),
            "metrics": dict((metrics or {}).get(role, {})),
        }
    write_json(directory / CARD, {"schema": SCHEMA, **origin.to_dict(), "estimators": entries, **(extra or {})})


def load_model(directory: Path, *, gripper: str = GRIPPER, camera: Camera | None = None) -> GraspModel:
    """Read a model for use with a gripper and a canonical camera.

    Args:
        directory: Where `save_model` wrote it.
        gripper: The gripper that will be used.
        camera: The camera that images are brought to; `canonical_camera()` if None.

    Raises:
        CheckpointError: Missing, damaged, or made for another schema, gripper or camera.
    """
    card = read_card(directory)
    check_card(card, directory, gripper, canonical_camera() if camera is None else camera)
    if unknown := [role for role in card["estimators"] if role not in ROLES]:
        raise CheckpointError(
            f"the model {directory} has estimators of unknown roles: {', '.join(unknown)}; this version knows "
            f"{', '.join(ROLES)}: train the model again"
        )
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
    for role, estimator in estimators.items():
        path = out / f"{role}.safetensors"
        write_tensors(path, estimator.state_dict(), {"role": role})
        joined["estimators"][role] = {**joined["estimators"][role], "sha256": _digest(path)}
    write_json(out / CARD, joined)


def read_card(directory: Path) -> dict[str, Any]:
    """The card of a model.

    Raises:
        CheckpointError: There is none, or it is not a card.
    """
    path = directory / CARD
    try:
        card = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CheckpointError(f"there is no model in {directory}: cannot read {CARD} ({error.strerror})") from error
    except ValueError as error:
        raise CheckpointError(f"the card {path} is not JSON: {error}") from error
    missing = [
        key for key in ("schema", "gripper", "camera", "estimators") if not isinstance(card, dict) or key not in card
    ]
    if missing:
        raise CheckpointError(f"the card {path} lacks {', '.join(missing)}")
    return dict(card)


def check_card(card: Mapping[str, Any], directory: Path, gripper: str, camera: Camera) -> None:
    """Refuse a model that was made for something else.

    Raises:
        CheckpointError: Another schema, gripper or camera.
    """
    if card["schema"] != SCHEMA:
        raise CheckpointError(f"the model {directory} has schema {card['schema']}, this version reads schema {SCHEMA}")
    if card["gripper"] != gripper:
        raise CheckpointError(f"the model {directory} is for the gripper {card['gripper']!r}, not for {gripper!r}")
    if not same_camera(card["camera"], camera.to_dict()):
        raise CheckpointError(
            f"the model {directory} was trained for another camera: {json.dumps(card['camera'])}, "
            f"not {json.dumps(camera.to_dict())}; train a model for this camera"
        )


def same_camera(left: Any, right: Any) -> bool:
    """Whether two cameras, as plain data, are the same up to rounding."""
    if isinstance(left, dict) and isinstance(right, dict):
        return left.keys() == right.keys() and all(same_camera(left[key], right[key]) for key in left)
    try:
        return bool(np.shape(left) == np.shape(right) and np.allclose(left, right, rtol=1e-6, atol=1e-6))
    except (TypeError, ValueError):
        return False


def kind_of(estimator: nn.Module) -> str:
    """Name of the estimator's architecture.

    Raises:
        CheckpointError: It is not one of ours.
    """
    for name, kind in KINDS.items():
        if type(estimator) is kind.module:
            return name
    raise CheckpointError(f"{type(estimator).__name__} is no estimator that can be saved; known: {', '.join(KINDS)}")


def write_json(path: Path, content: Any) -> None:
    """Write JSON that appears whole or not at all."""
    partial = path.with_name(f".{path.name}.partial")
    partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    os.replace(partial, path)


def _load_estimator(path: Path, entry: Any) -> nn.Module:
    if not isinstance(entry, dict) or not {"kind", "config", "sha256"} <= entry.keys():
        raise CheckpointError(f"the card's entry for {path.name} must have kind, config and sha256")
    config = config_from_dict(entry["kind"], entry["config"])
    with torch.random.fork_rng(devices=[]):  # the first weights are random, then replaced
        estimator = build(entry["kind"], config)
    tensors, _ = read_tensors(path)
    if _digest(path) != entry["sha256"]:
        raise CheckpointError(f"the weights {path} are not the ones of the card: the checksum differs")
    load_weights(estimator, tensors, path)
    return estimator.eval().requires_grad_(False)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
