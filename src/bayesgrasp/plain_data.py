"""Dataclasses as plain data (JSON), and back: nothing is converted that does not already have the right type.

A file that says 2.7 layers, or "true" for true, was altered or damaged. Numbers and lists can be bounded too: a number
in a file must not decide how much memory is taken.
"""

import dataclasses
import math
from collections.abc import Mapping
from functools import cache
from types import UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from bayesgrasp.errors import clipped, shown

Config = TypeVar("Config")


@dataclasses.dataclass(frozen=True)
class Limits:
    """What is believed of a file.

    Attributes:
        count: Largest absolute value of a whole number.
        number: Largest absolute value of a floating-point number; NaN and infinity are never believed.
        items: Length of a list.
    """

    count: int = 2**63 - 1
    number: float = math.inf
    items: int = 2**31


def plain(config: Any) -> dict[str, Any]:
    """A dataclass as JSON-able data."""
    return dataclasses.asdict(config)


def restored(target: type[Config], content: Any, limits: Limits | None = None) -> Config:
    """A dataclass from the data of `plain` that came through JSON: lists become tuples, objects dataclasses.

    Args:
        target: The class.
        content: The data.
        limits: What is believed of them.

    Raises:
        ValueError: Unknown or missing fields, another type than the field's, or a value out of range; the message is
            one short line.
    """
    try:
        result: Config = _restore(target, content, "", limits or Limits())
    except (TypeError, ValueError) as error:  # TypeError: a field is missing
        raise ValueError(clipped(error)) from error
    return result


def is_number(value: Any) -> bool:
    """Whether a value from JSON is a finite number; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return isinstance(value, int) or math.isfinite(value)


def _restore(target: Any, content: Any, place: str, limits: Limits) -> Any:
    origin, inner = get_origin(target), get_args(target)
    if dataclasses.is_dataclass(target):
        return _restore_fields(target, content, place, limits)
    if origin is UnionType:
        return None if content is None else _restore(inner[0], content, place, limits)
    if origin is tuple:
        return _restore_items(inner, content, place, limits)
    if origin is list:
        return list(_restore_items((*inner, ...), content, place, limits))
    if origin in (dict, Mapping):
        _demand(isinstance(content, dict) and len(content) <= limits.items, place, "an object", content)
        return {name: _restore(inner[1], value, f"{place}.{name}", limits) for name, value in content.items()}
    if origin is Literal:
        _demand(isinstance(content, str) and content in inner, place, f"one of {inner}", content)
        return content
    return content if target is Any else _restore_scalar(target, content, place, limits)


def _restore_scalar(target: Any, content: Any, place: str, limits: Limits) -> Any:
    if target is float:
        _demand(is_number(content) and abs(content) <= limits.number, place, "a finite number", content)
        return float(content)
    if target is int:
        _demand(type(content) is int and abs(content) <= limits.count, place, "a whole number", content)
    else:
        _demand(type(content) is target, place, target.__name__, content)
    return content


def _restore_fields(target: Any, content: Any, place: str, limits: Limits) -> Any:
    hints = _hints(target)
    known = isinstance(content, dict) and content.keys() <= hints.keys()
    _demand(known, place, f"an object with {', '.join(hints)}", content)
    return target(**{name: _restore(hints[name], value, f"{place}.{name}", limits) for name, value in content.items()})


@cache
def _hints(target: Any) -> dict[str, Any]:
    """Types of the fields of a dataclass, by name."""
    hints = get_type_hints(target)
    return {field.name: hints[field.name] for field in dataclasses.fields(target)}


def _restore_items(kinds: tuple[Any, ...], content: Any, place: str, limits: Limits) -> tuple[Any, ...]:
    length = len(content) if isinstance(content, list | tuple) else -1
    if kinds[1:] == (...,):
        _demand(0 <= length <= limits.items, place, "a list", content)
        kinds = kinds[:1] * length
    _demand(length == len(kinds), place, f"a list of {len(kinds)}", content)
    return tuple(_restore(kind, value, place, limits) for kind, value in zip(kinds, content, strict=True))


def _demand(fits: bool, place: str, what: str, content: Any) -> None:
    if not fits:
        raise ValueError(f"{shown(place.lstrip('.'))[1:-1] or 'it'} must be {what}, got {shown(content)}")
