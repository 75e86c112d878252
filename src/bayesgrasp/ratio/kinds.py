"""The estimators by name, and their configurations as JSON.

A checkpoint names the kind of each estimator and holds its configuration as plain data, so that loading builds the
module without running any code from the file.
"""

from dataclasses import dataclass
from typing import Any

from torch import nn

from bayesgrasp.errors import CheckpointError, InvalidConfigurationError, shown
from bayesgrasp.plain_data import Limits, plain, restored
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
from bayesgrasp.ratio.hand_success import HandSuccess, HandSuccessConfig
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
    "hand_success": Kind(HandSuccessConfig, HandSuccess),
    "image": Kind(ImageConfig, ImageRatio),
    "joint": Kind(ImageConfig, JointRatio),
    "full": Kind(FullConfig, FullSuccess),
    "global": Kind(ImageConfig, GlobalSuccess),
    "local": Kind(LocalConfig, LocalSuccess),
}
LIMITS = Limits(count=100_000, number=1e6, items=4096)
"""What is believed of a configuration in a file."""
KINDS_OF_ROLE = {
    "success_ratio": ("success_ratio", "hand_success"),
    "image": ("image",),
    "joint": ("joint",),
    "full": ("full",),
    "success": ("global", "local"),
}
"""The architectures that can play a role: they are called with what the role is told."""


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
    return plain(config)


def config_from_dict(kind: str, content: Any) -> object:
    """The configuration of a kind from `config_to_dict`'s data.

    Raises:
        CheckpointError: Unknown kind, missing or unknown fields, or values of another type or out of range.
    """
    if kind not in KINDS:
        raise CheckpointError(f"the model has an estimator of unknown kind {shown(kind)}; known: {', '.join(KINDS)}")
    try:
        return restored(KINDS[kind].config, content, LIMITS)
    except ValueError as error:
        raise CheckpointError(f"the configuration of the {kind} estimator is not valid: {error}") from error
