"""The Riemannian manifold R^3 x SO(3) of hand poses, with the grasp type as a label (paper, section 3.2).

A tangent vector at (x, R) is six numbers (v, w): a velocity v of the position, metres, in the world frame, and an
angular velocity w, radians, in the hand's own frame, so that R moves along R exp(t w). The metric needs a length that
one radian is worth, l (metres per radian):

    <(v, w), (v', w')> = v . v' / l^2 + w . w'.

It is bi-invariant on SO(3): geodesics are (x + t v, R exp(t w)), distances are sqrt(|dx|^2 / l^2 + angle^2) radians,
and parallel transport along (v, w) is exact: it leaves positions alone and turns angular velocities by exp(-w / 2).

The orthogonal projection of a Euclidean gradient G = df/dR is R skew(R^T G) (paper), whose inner product is the one of
matrices, trace(A^T B) = 2 a . b. In the metric above the gradient is therefore (l^2 df/dx, vee(R^T G - G^T R)). The
paper's search, with the plain product of R^3 and matrices, is the case l = sqrt(2) m/rad.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.types import Hands

PAPER_LENGTH_SCALE = math.sqrt(2.0)


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

    def inner(self, first: Float[Tensor, "*#batch 6"], second: Float[Tensor, "*#batch 6"]) -> Float[Tensor, "*batch"]:
        """Inner product of tangent vectors at the same point, rad^2."""
        position, rotation = (first * second).split(3, dim=-1)
        products: Float[Tensor, "*batch"] = position.sum(-1) / self.length_scale**2 + rotation.sum(-1)
        return products

    def norm(self, tangent: Float[Tensor, "*batch 6"]) -> Float[Tensor, "*batch"]:
        """Length of a tangent vector, radians."""
        return self.inner(tangent, tangent).sqrt()

    def euclidean_to_riemannian_gradient(
        self,
        rotation: Float[Tensor, "*batch 3 3"],
        position_gradient: Float[Tensor, "*batch 3"],
        rotation_gradient: Float[Tensor, "*batch 3 3"],
    ) -> Float[Tensor, "*batch 6"]:
        """The gradient as a tangent vector at `rotation`, from the derivatives df/dx (per metre) and df/dR."""
        turn = 2 * so3.vee(rotation.mT @ rotation_gradient)
        return torch.cat([self.length_scale**2 * position_gradient, turn], dim=-1)

    def retract(self, hands: Hands, tangent: Float[Tensor, "*batch 6"]) -> Hands:
        """Follow the geodesic for unit time (the exponential map); the grasp type stays.

        One Newton-Schulz step removes the rounding of the product, so float32 iterates stay on SO(3).
        """
        velocity, angular = tangent.split(3, dim=-1)
        turned = so3.renormalize(hands.rotation @ so3.exp(angular))
        return replace(hands, position=hands.position + velocity, rotation=turned)

    def log(self, start: Hands, end: Hands) -> Float[Tensor, "*batch 6"]:
        """The tangent vector at `start` that retracts to the pose of `end`; types are ignored.

        Unique while the rotations are less than pi apart.
        """
        return torch.cat([end.position - start.position, so3.log(start.rotation.mT @ end.rotation)], dim=-1)

    def transport(
        self, tangent: Float[Tensor, "*batch 6"], along: Float[Tensor, "*batch 6"]
    ) -> Float[Tensor, "*batch 6"]:
        """Parallel transport of a tangent vector along the geodesic of `along`, to its end."""
        position, rotation = tangent.split(3, dim=-1)
        turned = (so3.exp(-0.5 * along[..., 3:]) @ rotation[..., None]).squeeze(-1)
        return torch.cat([position, turned], dim=-1)

    def distance(self, first: Hands, second: Hands) -> Float[Tensor, "*batch"]:
        """Geodesic distance, radians, with `type_distance` in quadrature where the types differ."""
        shift = (first.position - second.position).square().sum(-1) / self.length_scale**2
        angle = so3.geodesic_distance(first.rotation, second.rotation)
        other = (first.grasp_type != second.grasp_type).to(shift.dtype) * self.type_distance**2
        return (shift + angle.square() + other).sqrt()
