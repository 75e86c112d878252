"""The card of a model, `card.json`: what its estimators are, where they come from, and for what they are valid.

The card names the schema, the gripper, the camera, the prior, the data and the commit that the estimators came from,
their kinds, configurations, checksums and metrics. A wrong card gives plausible and wrong grasps, so it is sealed
(`sealed.py`), and each of its entries is checked by name, type and range. Whoever changes a card on purpose seals it
again with `write_card`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bayesgrasp.errors import BayesgraspError, CheckpointError, FileError, shown
from bayesgrasp.files import MIB, read_json, write_json
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.observation.familiarity import Familiarity
from bayesgrasp.plain_data import is_number, restored
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.ratio.delivery import Delivery
from bayesgrasp.ratio.kinds import KINDS_OF_ROLE, LIMITS
from bayesgrasp.ratio.model import POWER, ROLES, route_given_image
from bayesgrasp.sealed import sealed, unsealed
from bayesgrasp.types import UNSTATED_HAND, HandIdentity

SCHEMA = 1
CARD = "card.json"
LARGEST = MIB
"""Bytes of a card."""
STRONGEST = 100.0
"""Power of a ratio; trained ones have about 1."""


def write_card(directory: Path, content: Mapping[str, Any]) -> None:
    """Write a card with its checksum."""
    write_json(directory / CARD, sealed(content))


def read_card(directory: Path) -> dict[str, Any]:
    """The card of a model.

    Raises:
        CheckpointError: There is none, it is damaged or was altered, or it is not a card of this version.
    """
    path = directory / CARD
    try:
        card = read_json(path, LARGEST)
    except FileError as error:
        raise CheckpointError(f"there is no model in {directory}: {error}") from error
    missing = [name for name in REQUIRED if not isinstance(card, dict) or name not in card]
    if missing:
        raise CheckpointError(f"the card {path} lacks {', '.join(missing)}")
    if type(card["schema"]) is not int or card["schema"] != SCHEMA:
        raise CheckpointError(
            f"the model {directory} has schema {shown(card['schema'])}, this version reads schema {SCHEMA}"
        )
    try:
        card = unsealed(card)
    except ValueError as error:
        raise CheckpointError(f"the card {path}: {error}; take the model from where it came, or train again") from error
    card.setdefault("gripper_sha256", UNSTATED_HAND)
    _check_entries(card, path)
    _check_objects(card, path)
    if "delivery" in card and tuple(card["delivery"]["weights"]) != promising_weights(card):
        raise CheckpointError(f"the card {path} tells what other weights delivered: calibrate this model again")
    return card


def promising_weights(card: Mapping[str, Any]) -> tuple[str, ...]:
    """SHA-256 of the estimators that promise success from an image, in the order of their route; none without one."""
    estimators = card["estimators"]
    return tuple(estimators[role]["sha256"] for role in route_given_image(estimators) or ())


def trained_hand(card: Mapping[str, Any]) -> HandIdentity:
    """The hand that a model is for."""
    return HandIdentity(card["gripper"], card["gripper_sha256"])


def check_card(card: Mapping[str, Any], directory: Path, hand: HandIdentity | None, camera: Camera) -> None:
    """Refuse a model that was made for something else.

    Raises:
        CheckpointError: Another gripper or camera.
    """
    if hand is not None and (another := trained_hand(card).compare(hand)):
        raise CheckpointError(f"the model {directory} is for {another}")
    if different := _differences(Camera.from_dict(card["camera"]).to_dict(), camera.to_dict()):
        raise CheckpointError(
            f"the model {directory} was trained for another camera: {different}; train a model for this camera"
        )


def _differences(left: Any, right: Any) -> str:
    """What two cameras, as plain data, differ in beyond rounding; empty where they are the same."""
    if isinstance(left, dict) and isinstance(right, dict):
        if left.keys() != right.keys():
            return f"states {', '.join(sorted(left))}, not {', '.join(sorted(right))}"
        found = ((name, _differences(left[name], right[name])) for name in left)
        return next((f"{name} {text}" for name, text in found if text), "")
    same = np.shape(left) == np.shape(right) and np.allclose(left, right, rtol=1e-6, atol=1e-6)
    return "" if same else f"is {shown(left)}, not {shown(right)}"


def _check_entries(card: Mapping[str, Any], path: Path) -> None:
    try:
        for name, value in card.items():
            if name not in ENTRIES:
                raise CheckpointError(f"there is no entry {shown(name)} in a card; known: {', '.join(ENTRIES)}")
            check, what = ENTRIES[name]
            if not check(value):
                raise CheckpointError(f"{name} must be {what}, got {shown(value)}")
    except BayesgraspError as error:
        raise CheckpointError(f"the card {path}: {error}") from error


def _check_objects(card: Mapping[str, Any], path: Path) -> None:
    """The full-observation estimator is told an object by its number, which must not be beyond those it knows."""
    known = card["estimators"].get("full", {}).get("config", {})
    named = card.get("objects", ())
    if named and isinstance(known, dict) and known.get("objects", len(named)) != len(named):
        raise CheckpointError(
            f"the card {path} names {len(named)} objects, its full estimator knows {shown(known['objects'])}"
        )


def _is_word(value: Any) -> bool:
    return isinstance(value, str) and 0 < len(value) <= 200 and value.isprintable()


def _is_sha256(value: Any) -> bool:
    return isinstance(value, str) and bool(re.fullmatch("[0-9a-f]{64}", value))


def _is_word_or_none(value: Any) -> bool:
    return value is None or _is_word(value)


def _are_distinct_words(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_word, value)) and len(set(value)) == len(value)


def _is_rate_or_none(value: Any) -> bool:
    return value is None or (is_number(value) and 0 <= value <= 1)


def _are_powers(value: Any) -> bool:
    known = isinstance(value, dict) and value.keys() <= set(ROLES)
    return known and all(is_number(power) and 0 < power <= STRONGEST for power in value.values())


def _is_camera(value: Any) -> bool:
    Camera.from_dict(value)
    return True


def _is_prior(value: Any) -> bool:
    try:
        restored(GraspPrior, value, LIMITS)
    except ValueError as error:
        raise CheckpointError(f"the prior is not valid: {error}") from error
    return True


def _is_familiarity(value: Any) -> bool:
    if isinstance(value, dict):
        Familiarity.from_dict(value)
    return value is None or isinstance(value, dict)


def _is_delivery(value: Any) -> bool:
    Delivery.from_dict(value)
    return True


def _are_estimators(value: Any) -> bool:
    """Roles are names of files, so an unknown one must not get any further."""
    if not isinstance(value, dict) or not value:
        return False
    if unknown := [role for role in value if role not in ROLES]:
        raise CheckpointError(
            f"it has estimators of unknown roles: {shown(', '.join(unknown))}; this version knows "
            f"{', '.join(ROLES)}: train the model again"
        )
    for role, entry in value.items():
        _check_estimator(role, entry)
    return True


def _check_estimator(role: str, entry: Any) -> None:
    names = ("kind", "config", "sha256", "metrics")
    if not isinstance(entry, dict) or set(entry) != set(names):
        raise CheckpointError(f"the entry of {role} must have {', '.join(names)}, got {shown(entry)}")
    if entry["kind"] not in KINDS_OF_ROLE[role]:
        raise CheckpointError(
            f"the {role} estimator is of unknown kind {shown(entry['kind'])}; known: {', '.join(KINDS_OF_ROLE[role])}"
        )
    if not _is_sha256(entry["sha256"]) or not isinstance(entry["metrics"], dict):
        raise CheckpointError(f"the entry of {role} needs a SHA-256 and metrics, got {shown(entry)}")


ENTRIES: dict[str, tuple[Callable[[Any], bool], str]] = {
    "schema": (lambda value: True, "the schema"),
    "gripper": (_is_word, "a name"),
    "gripper_sha256": (_is_sha256, "the SHA-256 of a description"),
    "camera": (_is_camera, "a camera"),
    "estimators": (_are_estimators, "estimators by role"),
    "prior": (_is_prior, "the prior of hands"),
    "data": (_is_word_or_none, "a fingerprint or null"),
    "commit": (_is_word_or_none, "a commit or null"),
    "success_rate": (_is_rate_or_none, "a rate between 0 and 1, or null"),
    "objects": (_are_distinct_words, "a list of distinct names"),
    "preset": (_is_word, "a name"),
    "cameras": (lambda value: value in ("canonical", "any"), "canonical or any"),
    "familiarity": (_is_familiarity, "image statistics, or null"),
    "delivery": (_is_delivery, "promises and outcomes of plans on fresh objects"),
    POWER: (_are_powers, f"a number in (0, {STRONGEST:g}] by role"),
}
"""What may stand in a card, and how it is checked; a check may also raise what is wrong."""
REQUIRED = ("schema", "gripper", "camera", "estimators")
