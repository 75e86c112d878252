"""Quadrature over SO(3) against known moments of Haar measure."""

import torch

from bayesgrasp.geometry import so3
from bayesgrasp.geometry.quadrature import rotation_quadrature


def test_moments_of_the_trace_are_exact() -> None:
    rotation, weight = rotation_quadrature(12)
    turned = so3.exp(torch.tensor([0.3, -1.0, 0.7], dtype=torch.float64)) @ rotation
    trace = turned.diagonal(dim1=-2, dim2=-1).sum(-1)
    # E trace^k counts the invariant vectors of the k-fold tensor power: the Riordan numbers.
    for power, moment in enumerate([1, 0, 1, 1, 3, 6, 15, 36]):
        torch.testing.assert_close((weight * trace**power).sum().item(), float(moment), rtol=1e-11, atol=1e-11)


def test_too_few_nodes_are_not_exact() -> None:
    rotation, weight = rotation_quadrature(4)
    trace = rotation.diagonal(dim1=-2, dim2=-1).sum(-1)
    assert abs(float((weight * trace**7).sum()) - 36) > 0.1
