"""What a client asks for: a depth file and a camera file in one piece of JSON, checked before anything is planned.

    {"depth": "<a depth file in base64>", "format": "png", "camera": {"intrinsics": {...}, "camera_to_world": {...}},
     "top": 5, "seed": 0,
     "constraints": {"keep_out": [{"low": [0, 0, 0], "high": [1, 1, 1]}], "lowest": 0.002,
                     "grasp_types": ["pinch"], "confidence": 0.95}}

`depth`, `format` and `camera` are needed. The files are those of `bayesgrasp plan` and are read by the same code;
`constraints` are named as in the JSON of a plan. A name that is not listed is refused: a misspelt limit must not be
taken for none.
"""

from __future__ import annotations

import base64
import binascii
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float32

from bayesgrasp.errors import InvalidConfigurationError, clipped, shown
from bayesgrasp.files import parsed_json
from bayesgrasp.geometry.box import Box
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.observation.depth_files import SUFFIXES, depth_of
from bayesgrasp.planning.constraints import EVERY_TYPE, UNCONSTRAINED, Constraints
from bayesgrasp.types import GraspType

MOST_GRASPS = 100
"""Of one answer."""
LARGEST_SEED = 2**63 - 1


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """One plan that is asked for; the attributes are arguments of `Planner.plan`."""

    depth: Float32[np.ndarray, "h w"]
    camera: Camera
    top: int = 5
    seed: int = 0
    constraints: Constraints = UNCONSTRAINED


def read_request(body: bytes) -> PlanRequest:
    """The request that a body holds.

    Raises:
        InvalidConfigurationError: Not JSON, a name is unknown or missing, or a value is not valid.
        DepthImageError: The depth image or the camera is not usable.
    """
    try:
        content = parsed_json(body.decode())
    except ValueError as error:
        raise InvalidConfigurationError(f"the request is not JSON: {clipped(error)}") from error
    _check_names("the request", content, {"depth", "format", "camera"}, {"top", "seed", "constraints"})
    return PlanRequest(
        depth_of(_decoded(content["depth"]), f".{_one_of('format', content['format'], _FORMATS)}"),
        Camera.from_dict(content["camera"]),
        _whole("top", content.get("top", 5), 1, MOST_GRASPS),
        _whole("seed", content.get("seed", 0), 0, LARGEST_SEED),
        _constraints(content.get("constraints", {})),
    )


_FORMATS = tuple(suffix.lstrip(".") for suffix in SUFFIXES)
_TYPES = {kind.name.lower(): kind for kind in EVERY_TYPE}


def _check_names(what: str, content: Any, needed: set[str], allowed: set[str]) -> None:
    if not isinstance(content, dict):
        raise InvalidConfigurationError(f"{what} must be an object, got {shown(content)}")
    known = needed | allowed
    if wrong := sorted((content.keys() - known) | (needed - content.keys())):
        raise InvalidConfigurationError(
            f"{what} holds {', '.join(sorted(known))}; missing or unknown: {clipped(', '.join(wrong))}"
        )


def _decoded(text: Any) -> bytes:
    if not isinstance(text, str):
        raise InvalidConfigurationError(f"depth must be a depth file in base64, got {shown(text)}")
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise InvalidConfigurationError(f"depth must be a depth file in base64: {clipped(error)}") from error


def _one_of(name: str, value: Any, choices: Collection[str]) -> str:
    if not isinstance(value, str) or value not in choices:
        raise InvalidConfigurationError(f"{name} must be one of {', '.join(choices)}, got {shown(value)}")
    return value


def _whole(name: str, value: Any, low: int, high: int) -> int:
    if type(value) is not int or not low <= value <= high:
        raise InvalidConfigurationError(f"{name} must be a whole number from {low} to {high}, got {shown(value)}")
    return value


def _constraints(content: Any) -> Constraints:
    _check_names("constraints", content, set(), {"keep_out", "lowest", "grasp_types", "confidence"})
    types = content.get("grasp_types", list(_TYPES))
    return Constraints(
        tuple(_box(box) for box in _list("keep_out", content.get("keep_out", []))),
        _number("lowest", content.get("lowest")),
        tuple(_type(kind) for kind in _list("grasp_types", types)),
        _number("confidence", content.get("confidence")),
    )


def _type(name: Any) -> GraspType:
    return _TYPES[_one_of("a grasp type", name, _TYPES)]


def _list(name: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise InvalidConfigurationError(f"{name} must be a list, got {shown(value)}")
    return value


def _number(name: str, value: Any) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidConfigurationError(f"{name} must be a number, got {shown(value)}")
    return float(value)


def _box(content: Any) -> Box:
    _check_names("a box of keep_out", content, {"low", "high"}, set())
    return Box(_corner(content["low"]), _corner(content["high"]))


def _corner(value: Any) -> tuple[float, float, float]:
    match [_number("a corner's coordinate", each) for each in _list("a corner", value)]:
        case [float(x), float(y), float(z)]:
            return x, y, z
    raise InvalidConfigurationError(f"a corner is three numbers, metres, got {shown(value)}")
