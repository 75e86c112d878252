"""Configurations as plain data (JSON), and back: nothing is converted that does not already have the right type.

A card that says 2.7 layers, or "true" for true, was altered or damaged. Sizes are bounded too: a number in a file must
not decide how much memory is taken before the weights have shown that there are so many of them.
"""

import dataclasses
import math
from types import UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from bayesgrasp.errors import CheckpointError, clipped, shown

LARGEST_COUNT = 100_000
LARGEST_NUMBER = 1e6
MOST_ITEMS = 4096
Config = TypeVar("Config")


def plain(config: Any) -> dict[str, Any]:
    """A configuration as JSON-able data."""
    return dataclasses.asdict(config)


def restored(target: type[Config], content: Any, name: str) -> Config:
    """A configuration from the data of `plain` that came through JSON: lists become tuples, objects dataclasses.

    Args:
        target: The class of the configuration.
        content: The data.
        name: Of the configuration, for messages.

    Raises:
        CheckpointError: Unknown or missing fields, another type than the field's, or a value out of range.
    """
    try:
        result: Config = _restore(target, content, "")
    except (TypeError, ValueError) as error:  # ValueError: what the configurations themselves raise
        raise CheckpointError(f"{name} is not valid: {clipped(error)}") from error
    return result


def _restore(target: Any, content: Any, place: str) -> Any:
    if dataclasses.is_dataclass(target):
        return _restore_fields(target, content, place)
    if get_origin(target) is UnionType:
        return None if content is None else _restore(get_args(target)[0], content, place)
    if get_origin(target) is tuple:
        return _restore_items(get_args(target), content, place)
    if get_origin(target) is Literal:
        _demand(isinstance(content, str) and content in get_args(target), place, f"one of {get_args(target)}", content)
    elif target is float:
        _demand(is_number(content) and abs(content) <= LARGEST_NUMBER, place, "a finite number", content)
        return float(content)
    elif target is int:
        _demand(type(content) is int and abs(content) <= LARGEST_COUNT, place, "a whole number", content)
    else:
        _demand(type(content) is target, place, target.__name__, content)
    return content


def _restore_fields(target: Any, content: Any, place: str) -> Any:
    hints = get_type_hints(target)
    hints = {field.name: hints[field.name] for field in dataclasses.fields(target)}
    known = isinstance(content, dict) and content.keys() <= hints.keys()
    _demand(known, place, f"an object with {', '.join(hints)}", content)
    return target(**{name: _restore(hints[name], value, f"{place}.{name}") for name, value in content.items()})


def _restore_items(kinds: tuple[Any, ...], content: Any, place: str) -> tuple[Any, ...]:
    if kinds[1:] == (...,):
        _demand(isinstance(content, list | tuple) and len(content) <= MOST_ITEMS, place, "a list", content)
        kinds = kinds[:1] * len(content)
    _demand(isinstance(content, list | tuple) and len(content) == len(kinds), place, f"a list of {len(kinds)}", content)
    return tuple(_restore(kind, value, place) for kind, value in zip(kinds, content, strict=True))


def _demand(fits: bool, place: str, what: str, content: Any) -> None:
    if not fits:
        raise TypeError(f"{place.lstrip('.') or 'it'} must be {what}, got {shown(content)}")


def is_number(value: Any) -> bool:
    """Whether a value from JSON is a finite number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
