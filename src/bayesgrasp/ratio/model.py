"""A trained model: the estimators of one preset, and the log-ratios they make for one image.

    success         a log p(S=1 | i, h)                     = log r(S=1, i | h) + a constant in h  (a: `training.power`)
    image           log r(i | S=1, h) + log r(S=1 | h)      = log r(S=1, i | h)    (paper, eq. 4)
    joint           log r(S=1, i | h) by one network: the ablation
    success_ratio   log r(S=1 | h), no image
    held            log p(held | i, h), a second output of ``success``
    full            log p(S=1 | O, p_O, beta, mu, h)        = log r(S=1, O, p_O, beta, mu | h) + a constant in h

Each is a function of hands of any batch shape, differentiable in position and rotation.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

import torch
import torch.nn.functional as F  # noqa: N812
from jaxtyping import Float, Int
from torch import Tensor, nn

from bayesgrasp.errors import CheckpointError
from bayesgrasp.ratio.estimators import ObjectState
from bayesgrasp.types import Hands

Role = Literal["success_ratio", "image", "joint", "success", "full"]
"""What an estimator is for."""
ROLES: tuple[Role, ...] = get_args(Role)
LogRatio = Callable[[Hands], Tensor]
"""From hands to values of the same batch shape."""
IMAGE_ROUTES = (("success",), ("image", "success_ratio"), ("joint",))
"""Estimators that make log r(S=1, i | h), the preferred ones first."""
POWER = "power"
"""Entry of a card: by role, the power of the ratio at which its posterior is calibrated (`training.power`)."""


@dataclass(frozen=True)
class SuccessGivenImage:
    """a log p(S=1 | i, h) for one image."""

    estimator: nn.Module
    context: Any
    power: float = 1.0

    def log_ratio(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Log success probability times the power, which is the log-ratio up to a constant in h."""
        logit: Tensor = self.estimator(self.context, as_row(hands))
        return self.power * F.logsigmoid(logit.reshape(hands.shape))


@dataclass(frozen=True)
class HeldGivenImage:
    """log p(held | i, h) for one image."""

    estimator: Any
    context: Any

    def log_probability(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Log probability that the grasp lifts the object and holds it against pushes."""
        _, held = self.estimator.both(self.context, as_row(hands))
        return F.logsigmoid(held.reshape(hands.shape))


@dataclass(frozen=True)
class FactorisedRatio:
    """log r(i | S=1, h) + log r(S=1 | h) for one image."""

    image: nn.Module
    success_ratio: nn.Module
    context: Any

    def log_ratio(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Log r(S=1, i | h)."""
        row = as_row(hands)
        value: Tensor = self.image(self.context, row) + self.success_ratio(torch.ones_like(row.position[..., 0]), row)
        return value.reshape(hands.shape)


@dataclass(frozen=True)
class JointGivenImage:
    """log r(S=1, i | h) by one network."""

    estimator: nn.Module
    context: Any

    def log_ratio(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Log r(S=1, i | h)."""
        row = as_row(hands)
        value: Tensor = self.estimator(self.context, row, torch.ones_like(row.position[..., 0]))
        return value.reshape(hands.shape)


@dataclass(frozen=True)
class SuccessRatioOnly:
    """log r(S=1 | h)."""

    estimator: nn.Module

    def log_ratio(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Log r(S=1 | h)."""
        value: Tensor = self.estimator(torch.ones_like(hands.position[..., 0]), hands)
        return value


@dataclass(frozen=True)
class SuccessGivenObject:
    """log p(S=1 | O, p_O, beta, mu, h) for one scene."""

    estimator: nn.Module
    index: Int[Tensor, "1"]
    scale: Float[Tensor, "1"]
    pose: Float[Tensor, "1 3"]
    friction: float

    def log_ratio(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Log success probability, which is the log-ratio up to a constant in h."""
        row = as_row(hands)
        friction = torch.full_like(row.position[..., 0], self.friction)
        value = self.estimator(ObjectState(self.index, self.scale, self.pose, friction), row)
        return F.logsigmoid(value).reshape(hands.shape)


@dataclass(frozen=True)
class GraspModel:
    """Estimators by role, in evaluation mode, and the card they came with.

    Attributes:
        estimators: Some of `ROLES`.
        card: See `checkpoint.py`; empty for a model that was never saved.
    """

    estimators: Mapping[str, nn.Module]
    card: Mapping[str, Any]

    @property
    def power(self) -> float:
        """The power of p(S=1 | i, h) in the posterior; 1 for a model that was never calibrated."""
        return float(self.card.get(POWER, {}).get("success", 1.0))

    def to(self, device: torch.device | str) -> GraspModel:
        """The same model with its estimators moved to a device; images and hands must be there, too."""
        return GraspModel({role: estimator.to(device) for role, estimator in self.estimators.items()}, self.card)

    def given_image(self, image: Float[Tensor, "1 height width"]) -> LogRatio:
        """Log r(S=1, i | h) as a function of h, up to a constant, by the first of `IMAGE_ROUTES` that the model has.

        Args:
            image: Depth image, metres, 0 = no return, as the network was trained on.

        Raises:
            CheckpointError: The model has no estimator for it.
        """
        route = route_given_image(self.estimators)
        if route == ("success",):
            return SuccessGivenImage(self.estimators["success"], self._encode("success", image), self.power).log_ratio
        if route == ("joint",):
            return JointGivenImage(self.estimators["joint"], self._encode("joint", image)).log_ratio
        parts = self._role("image"), self._role("success_ratio")
        return FactorisedRatio(*parts, self._encode("image", image)).log_ratio

    @property
    def holds(self) -> bool:
        """Whether the model says how likely a grasp is to hold against pushes."""
        return getattr(self.estimators.get("success"), "held", None) is not None

    def held_given_image(self, image: Float[Tensor, "1 height width"]) -> LogRatio:
        """Log p(held | i, h) as a function of h; image as for `given_image`.

        Raises:
            CheckpointError: The model has no estimator for it.
        """
        return HeldGivenImage(self._role("success"), self._encode("success", image)).log_probability

    def given_success(self) -> LogRatio:
        """Log r(S=1 | h)."""
        return SuccessRatioOnly(self._role("success_ratio")).log_ratio

    def given_object(self, index: int, scale: float, pose: tuple[float, float, float], friction: float) -> LogRatio:
        """Log r(S=1, O, p_O, beta, mu | h) as a function of h, up to a constant.

        Args:
            index: Mesh, in the order of the training data.
            scale: beta.
            pose: (x, y, yaw), metres and radians.
            friction: Lateral friction coefficient.
        """
        known = torch.tensor([index]), torch.tensor([scale]), torch.tensor([pose])
        return SuccessGivenObject(self._role("full"), *known, friction).log_ratio

    def _role(self, role: str) -> nn.Module:
        if role not in self.estimators:
            raise CheckpointError(f"this model has no {role!r} estimator; it has {', '.join(self.estimators)}")
        return self.estimators[role]

    def _encode(self, role: str, image: Tensor) -> Any:
        with torch.no_grad():
            return self._role(role).encode(image[None])  # type: ignore[operator]


def route_given_image(roles: Collection[str]) -> tuple[str, ...] | None:
    """The first of `IMAGE_ROUTES` that is among the roles; None where there is none."""
    return next((route for route in IMAGE_ROUTES if set(route) <= set(roles)), None)


def as_row(hands: Hands) -> Hands:
    """Hands of any batch shape as (1, n)."""
    position, rotation = hands.position.reshape(1, -1, 3), hands.rotation.reshape(1, -1, 3, 3)
    return Hands(position, rotation, hands.grasp_type.reshape(1, -1))
