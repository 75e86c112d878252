"""The Riemannian manifold R^3 x SO(3) of hand poses, with the grasp type as a label (paper, section 3.2).

A tangent vector at (x, R) is six numbers (v, w): a velocity v of the position, metres, in the world frame, and an
angular velocity w, radians, in the hand's own frame, so that R moves along R exp(t w). The metric needs a length that
one radian is worth, l (metres per radian):

    <(v, w), (v', w')> = v . v' / l^2 + w . w'.

It is bi-invariant on SO(3): geodesics are (x + t v, R exp(t w)), and distances are sqrt(|dx|^2 / l^2 + angle^2)
radians. The gradient of a function on it is in `posterior.potential`. The paper's search, with the plain product of R^3
and matrices, is the case l = sqrt(2) m/rad, since trace(hat(w)^T hat(w')) = 2 w . w'.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Float64
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.types import Hands


def carried(hands: Hands, motion: Float64[np.ndarray, "4 4"]) -> Hands:
    """Hands carried along by a rigid motion, or the same hands in another frame; densities of hands do not change."""
    if np.array_equal(motion, np.eye(4)):
        return hands
    rotation, translation = (hands.position.new_tensor(part) for part in (motion[:3, :3], motion[:3, 3]))
    return replace(hands, position=hands.position @ rotation.mT + translation, rotation=rotation @ hands.rotation)


@dataclass(frozen=True)
class GraspSpace:
    """The metric on hand configurations.

    Attributes:
        length_scale: l, metres per radian. Fingertips are about 0.1 m ahead of the palm's origin, so at the default a
            turn and a shift of equal length move them equally far.
        type_distance: What a different grasp type adds, in quadrature, to a distance; radians. The default is a turn
            that carries one mode of the rotation prior half way to the next.

    Raises:
        InvalidConfigurationError: A value is not finite, the length is not positive, or the distance is negative.
    """

    length_scale: float = 0.1
    type_distance: float = math.pi / 4

    def __post_init__(self) -> None:
        if not (math.isfinite(self.length_scale) and self.length_scale > 0):
            raise InvalidConfigurationError(f"length_scale must be finite and > 0 m/rad, got {self.length_scale}")
        if not (math.isfinite(self.type_distance) and self.type_distance >= 0):
            raise InvalidConfigurationError(f"type_distance must be finite and >= 0 rad, got {self.type_distance}")

    def per_radian(self, like: Tensor) -> Float[Tensor, "6"]:
        """What a radian of the metric is along each axis of a tangent vector, metres and radians; type as of `like`."""
        return like.new_tensor([self.length_scale] * 3 + [1.0] * 3)

    def retract(self, hands: Hands, tangent: Float[Tensor, "*batch 6"]) -> Hands:
        """Follow the geodesic for unit time (the exponential map); the grasp type stays.

        One Newton-Schulz step removes the rounding of the product, so float32 iterates stay on SO(3).
        """
        velocity, angular = tangent.split(3, dim=-1)
        turned = so3.renormalize(hands.rotation @ so3.exp(angular))
        return replace(hands, position=hands.position + velocity, rotation=turned)

    def distance(self, first: Hands, second: Hands) -> Float[Tensor, "*batch"]:
        """Geodesic distance, radians, with `type_distance` in quadrature where the types differ."""
        shift = (first.position - second.position).square().sum(-1) / self.length_scale**2
        angle = so3.geodesic_distance(first.rotation, second.rotation)
        other = (first.grasp_type != second.grasp_type).to(shift.dtype) * self.type_distance**2
        return (shift + angle.square() + other).sqrt()
