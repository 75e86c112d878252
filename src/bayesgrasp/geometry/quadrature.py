"""Integrals over SO(3) by a product rule, for checks and for closed forms."""

from __future__ import annotations

import math

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor

from bayesgrasp.geometry import so3


def rotation_quadrature(nodes: int) -> tuple[Float64[Tensor, "m 3 3"], Float64[Tensor, "m"]]:
    """Rotations Rz(a) Ry(b) Rz(c) and their weights, which sum to 1 (Haar measure); m = nodes^3.

    Trapezoids in a and c and Gauss-Legendre in cos b: exact for polynomials in the entries of R of a degree below
    `nodes`, and converging faster than any power for analytic functions.
    """
    turn = torch.arange(nodes, dtype=torch.float64) * (2 * math.pi / nodes)
    cosine, weight = (torch.from_numpy(v) for v in np.polynomial.legendre.leggauss(nodes))
    y, z = torch.eye(3, dtype=torch.float64)[1:]
    about_z, about_y = so3.exp(turn[:, None] * z), so3.exp(cosine.arccos()[:, None] * y)
    rotation = about_z[:, None, None] @ about_y[None, :, None] @ about_z[None, None, :]
    weights = (weight / 2)[None, :, None].expand(nodes, nodes, nodes) / nodes**2
    return rotation.reshape(-1, 3, 3), weights.reshape(-1)
