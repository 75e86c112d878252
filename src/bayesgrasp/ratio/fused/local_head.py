"""The head of `ratio.local` on hands of one image, with its derivative in their poses written out.

It computes what `LocalSuccess.forward` does, without a graph: look-ups are compiled (`look_up_kernels`), layers are
products with the module's own weights, and the way back goes through both in reverse:

    a_0 = (hand, tanh(depths), features),  z_l = W_l a_(l-1) + b_l,  a_l = phi(z_l); dz_l = phi'(z_l) W_(l+1)^T dz_(l+1)

Torch sees one function, so whatever is built on it is differentiated as ever.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from jaxtyping import Float
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

from bayesgrasp.ratio.fused.look_up_kernels import Evidence, Eye, look_up, pull_back
from bayesgrasp.ratio.layers import HandFeatures
from bayesgrasp.types import Hands

ROWS = 256
"""Hands at once where no gradient is wanted, so that what stands between the layers stays in the processor's cache."""
POSE = 12
"""Numbers of a position and a rotation."""


@dataclass(frozen=True)
class LocalHead:
    """A head, bound to an image.

    Attributes:
        features: The hand as a vector.
        eye: Camera and points of the hand.
        evidence: What is looked up in the image.
        layers: Fully connected layers, SiLU between them.
        shift: The image's share of the first layer, (width,).
    """

    features: HandFeatures
    eye: Eye
    evidence: Evidence
    layers: nn.Sequential
    shift: Float[Tensor, "width"]

    def values(self, hands: Hands) -> Float[Tensor, "n outputs"]:
        """Outputs for hands (n,), differentiable in position and rotation."""
        if torch.is_grad_enabled() and (hands.position.requires_grad or hands.rotation.requires_grad):
            value: Tensor = _Values.apply(hands.position, hands.rotation, hands.grasp_type, self)  # type: ignore[no-untyped-call]
            return value
        hands = _plain(hands)
        starts = range(0, max(len(hands.grasp_type), 1), ROWS)
        return torch.cat([self.run(hands[start : start + ROWS])[0] for start in starts])

    def run(self, hands: Hands) -> tuple[Float[Tensor, "n outputs"], list[Tensor]]:
        """Outputs, and what the way back needs: the inputs, then what enters each activation."""
        inputs = self._inputs(hands)
        first, *rest = self._linear
        kept = [inputs, torch.addmm(first.bias + self.shift, inputs, first.weight.t())]
        for layer in rest:
            kept.append(torch.addmm(layer.bias, F.silu(kept[-1]), layer.weight.t()))
        return kept.pop(), kept

    def pull(self, hands: Hands, kept: list[Tensor], gradient: Float[Tensor, "n outputs"]) -> Float[Tensor, "n 12"]:
        """Derivatives in position and rotation, row by row, from those in the outputs."""
        first, *rest = self._linear
        for layer, entering in zip(reversed(rest), reversed(kept[1:]), strict=True):
            gradient = torch.ops.aten.silu_backward(gradient @ layer.weight, entering)
        gradient = gradient @ first.weight
        squashed = self._squashed(kept[0])
        self._squashed(gradient).mul_(1 - squashed * squashed)
        by_pose = gradient[:, :POSE].clone()
        by_pose[:, :3] /= self.features.reach
        arrays = hands.position.numpy(), hands.rotation.numpy()
        pull_back(*arrays, self.eye, self.evidence, self._start, gradient.numpy(), by_pose.numpy())
        return by_pose

    @property
    def _linear(self) -> list[nn.Linear]:
        return [layer for layer in self.layers if isinstance(layer, nn.Linear)]

    def _inputs(self, hands: Hands) -> Float[Tensor, "n width"]:
        vector: Tensor = self.features(hands)
        inputs = vector.new_empty(len(vector), self._linear[0].in_features)
        inputs[:, : self._start] = vector
        arrays = hands.position.numpy(), hands.rotation.numpy()
        look_up(*arrays, self.eye, self.evidence, self._start, inputs.numpy())
        squashed = self._squashed(inputs).numpy()
        np.tanh(squashed, out=squashed)
        return inputs

    def _squashed(self, inputs: Float[Tensor, "n width"]) -> Float[Tensor, "n squashed"]:
        """The columns that go through tanh: signed depths."""
        depths = len(self.evidence.scales) + self.evidence.offsets.shape[-1]
        return inputs[:, self._start : self._start + depths * self.eye.points.shape[-1]]

    @property
    def _start(self) -> int:
        """The first column of the evidence."""
        return POSE + self.features.embedding.embedding_dim


class _Values(torch.autograd.Function):
    """A head as one node of a graph."""

    @staticmethod
    def forward(ctx: Any, position: Tensor, rotation: Tensor, grasp_type: Tensor, head: LocalHead) -> Tensor:
        ctx.head, ctx.hands = head, _plain(Hands(position, rotation, grasp_type))
        outputs, ctx.kept = head.run(ctx.hands)
        return outputs

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        by_position, by_rotation = ctx.head.pull(ctx.hands, ctx.kept, gradient).split([3, 9], -1)
        return by_position, by_rotation.unflatten(-1, (3, 3)), None, None


def _plain(hands: Hands) -> Hands:
    """The same hands for compiled loops: no graph, no gaps in memory."""
    return Hands(hands.position.detach().contiguous(), hands.rotation.detach().contiguous(), hands.grasp_type)
