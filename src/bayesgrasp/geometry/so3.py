"""Rotations: quaternions, matrices, the exponential map and its inverse, accurate and differentiable everywhere.

A rotation vector w (radians) is mapped to its rotation by Rodrigues' formula

    exp(w) = I + (sin t / t) hat(w) + ((1 - cos t) / t^2) hat(w)^2,    t = |w|.

Both coefficients, and the one of the logarithm, are analytic in the squared norm; near zero they are evaluated by
their series, so values and gradients are right at the identity. At t = pi the logarithm is cut (two vectors, one
rotation); it stays finite there. Quaternions are (w, x, y, z); q and -q are the same rotation.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

SERIES_BELOW = 1e-2
"""Squared norm below which series replace quotients; their truncation error is below 1e-15 there."""


def hat(vector: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """The skew matrix of the cross product from the left with a vector."""
    x, y, z = vector.unbind(-1)
    o = torch.zeros_like(x)
    matrix: Float[Tensor, "*batch 3 3"] = torch.stack([o, -z, y, z, o, -x, -y, x, o], dim=-1).unflatten(-1, (3, 3))
    return matrix


def vee(matrix: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 3"]:
    """The inverse of `hat`; only the skew part of the matrix counts."""
    m = skew(matrix)
    return torch.stack([m[..., 2, 1], m[..., 0, 2], m[..., 1, 0]], dim=-1)


def skew(matrix: Float[Tensor, "*batch n n"]) -> Float[Tensor, "*batch n n"]:
    """The skew-symmetric part (A - A^T) / 2 (paper, section 3.2)."""
    return 0.5 * (matrix - matrix.mT)


def exp(vector: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """The rotation by |vector| radians about the vector."""
    squared = vector.square().sum(-1)
    near = squared < SERIES_BELOW
    safe = torch.where(near, 1.0, squared)
    angle = safe.sqrt()
    sine = torch.where(near, _series(squared, 1.0, -1 / 6, 1 / 120, -1 / 5040, 1 / 362880), angle.sin() / angle)
    # (1 - cos t) / t^2 = 2 sin^2(t / 2) / t^2 has no cancellation.
    cosine = torch.where(
        near,
        _series(squared, 1 / 2, -1 / 24, 1 / 720, -1 / 40320, 1 / 3628800),
        2 * (angle / 2).sin().square() / safe,
    )
    h = hat(vector)
    eye = torch.eye(3, dtype=vector.dtype, device=vector.device)
    return eye + sine[..., None, None] * h + cosine[..., None, None] * (h @ h)


def log(rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 3"]:
    """The rotation vector, radians, of norm at most pi; at pi either of the two."""
    quaternion = matrix_to_quaternion(rotation)
    real, imaginary = quaternion[..., 0], quaternion[..., 1:]
    squared = imaginary.square().sum(-1)
    near = squared < SERIES_BELOW
    safe_real = torch.where(near, real, 1.0)
    sine = torch.where(near, 1.0, squared).sqrt()
    ratio = squared / safe_real.square()
    coefficients = [(-1) ** k / (2 * k + 1) for k in range(8)]  # of atan(s) / s
    factor = torch.where(near, _series(ratio, *coefficients) / safe_real, torch.atan2(sine, real) / sine)
    return 2 * factor[..., None] * imaginary


def geodesic_distance(
    first: Float[Tensor, "*#batch 3 3"], second: Float[Tensor, "*#batch 3 3"]
) -> Float[Tensor, "*batch"]:
    """The angle between two rotations, radians in [0, pi]; its gradient is zero where they coincide."""
    squared = log(first.mT @ second).square().sum(-1)
    zero = squared == 0
    return torch.where(zero, 0.0, torch.where(zero, 1.0, squared).sqrt())


def quaternion_to_matrix(quaternion: Float[Tensor, "*batch 4"]) -> Float[Tensor, "*batch 3 3"]:
    """The rotation of a quaternion (w, x, y, z), which is normalised first."""
    w, x, y, z = torch.nn.functional.normalize(quaternion, dim=-1).unbind(-1)
    entries = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ]
    matrix: Float[Tensor, "*batch 3 3"] = torch.stack(entries, dim=-1).unflatten(-1, (3, 3))
    return matrix


def matrix_to_quaternion(rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 4"]:
    """The unit quaternion (w, x, y, z) with w >= 0 of a rotation.

    The matrix 4 q q^T is linear in R. Its longest column, whose norm is at least 2, is q up to length and sign, so no
    small number is ever a divisor and the gradient is finite everywhere.
    """
    (a, b, c), (d, e, f), (g, h, i) = (row.unbind(-1) for row in rotation.unbind(-2))
    columns = [
        *(1 + a + e + i, h - f, c - g, d - b),
        *(h - f, 1 + a - e - i, b + d, c + g),
        *(c - g, b + d, 1 - a + e - i, f + h),
        *(d - b, c + g, f + h, 1 - a - e + i),
    ]
    outer = torch.stack(columns, dim=-1).unflatten(-1, (4, 4))
    longest = outer.diagonal(dim1=-2, dim2=-1).argmax(-1)
    index = longest[..., None, None].expand(*longest.shape, 1, 4)
    quaternion = torch.nn.functional.normalize(outer.gather(-2, index).squeeze(-2), dim=-1)
    return torch.where(quaternion[..., :1] < 0, -quaternion, quaternion)


def random_rotation(n: int, rng: np.random.Generator, dtype: torch.dtype = torch.float32) -> Float[Tensor, "{n} 3 3"]:
    """Rotations drawn uniformly (Haar measure): a normalised Gaussian is uniform on the 3-sphere."""
    return quaternion_to_matrix(torch.from_numpy(rng.standard_normal((n, 4)))).to(dtype)


def renormalize(rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 3 3"]:
    """Remove rounding drift from a near-rotation: one Newton-Schulz step R (3 I - R^T R) / 2.

    An error e becomes O(e^2), so in float32 one step after every product keeps a chain of any length on SO(3).
    """
    eye = torch.eye(3, dtype=rotation.dtype, device=rotation.device)
    return rotation @ (1.5 * eye - 0.5 * (rotation.mT @ rotation))


def _series(x: Tensor, *coefficients: float) -> Tensor:
    """Horner's rule for a polynomial, lowest coefficient first."""
    result = torch.full_like(x, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        result = result * x + coefficient
    return result
