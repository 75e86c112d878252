"""The estimators by name, and their configurations as JSON.

A checkpoint names the kind of each estimator and holds its configuration as plain data, so that loading builds the
module without running any code from the file.
"""

import dataclasses
from dataclasses import dataclass
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from torch import nn

from bayesgrasp.errors import CheckpointError, InvalidConfigurationError
from bayesgrasp.ratio.estimators import (
    FullConfig,
    FullSuccess,
    GlobalSuccess,
    ImageConfig,
    ImageRatio,
    JointRatio,
    SuccessRatio,
    SuccessRatioConfig,
)
from bayesgrasp.ratio.local import LocalConfig, LocalSuccess


@dataclass(frozen=True)
class Kind:
    """An architecture.

    Attributes:
        config: Its configuration class.
        module: Its class, built from the configuration alone.
    """

    config: type
    module: type[nn.Module]


KINDS: dict[str, Kind] = {
    "success_ratio": Kind(SuccessRatioConfig, SuccessRatio),
    "image": Kind(ImageConfig, ImageRatio),
    "joint": Kind(ImageConfig, JointRatio),
    "full": Kind(FullConfig, FullSuccess),
    "global": Kind(ImageConfig, GlobalSuccess),
    "local": Kind(LocalConfig, LocalSuccess),
}


def build(kind: str, config: object) -> nn.Module:
    """The estimator of a kind.

    Raises:
        InvalidConfigurationError: No such kind, or the configuration of another one.
    """
    if kind not in KINDS:
        raise InvalidConfigurationError(f"there is no estimator {kind!r}; choose from {', '.join(KINDS)}")
    if not isinstance(config, KINDS[kind].config):
        raise InvalidConfigurationError(f"{kind} needs a {KINDS[kind].config.__name__}, got {type(config).__name__}")
    return KINDS[kind].module(config)


def config_to_dict(config: Any) -> dict[str, Any]:
    """A configuration as JSON-able data."""
    return dataclasses.asdict(config)


def config_from_dict(kind: str, content: Any) -> object:
    """The configuration of a kind from `config_to_dict`'s data.

    Raises:
        CheckpointError: Unknown kind, missing or unknown fields, or values out of range.
    """
    if kind not in KINDS:
        raise CheckpointError(f"the model has an estimator of unknown kind {kind!r}; known: {', '.join(KINDS)}")
    try:
        return _restore(KINDS[kind].config, content)
    except (TypeError, ValueError, KeyError) as error:
        raise CheckpointError(f"the configuration of the {kind} estimator is not valid: {error}") from error


def _restore(target: Any, content: Any) -> Any:
    """Undo JSON: objects become dataclasses, lists become tuples."""
    if dataclasses.is_dataclass(target) and isinstance(target, type):
        hints = get_type_hints(target)
        return target(**{name: _restore(hints[name], value) for name, value in content.items()})
    if get_origin(target) is UnionType:
        return None if content is None else _restore(get_args(target)[0], content)
    if get_origin(target) is tuple:
        kinds = get_args(target)
        kinds = kinds[:1] * len(content) if kinds[1:] == (...,) else kinds
        return tuple(_restore(kind, value) for kind, value in zip(kinds, content, strict=True))
    return target(content) if target in (int, float) else content
