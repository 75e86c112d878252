"""What each estimator is trained to do with a batch (paper, Algorithm 1): a loss of estimator and batch.

The products of marginals are formed inside the batch: the image of a scene meets the hands of other scenes, shifted by
a random number of scenes, with the product of the weights. A pair of a scene with itself never occurs: it has
probability zero under the product of marginals.

Since S is binary, d_phi is trained with S = 0 and S = 1 equally often in both classes, which leaves r(S | h) as it is
(`docs/method.md`) and makes the rare successes count.
"""

import math
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.ratio.estimators import ObjectState
from bayesgrasp.training.losses import LossConfig, balanced_nre, nre_a, nre_c, success_loss
from bayesgrasp.types import Hands


@runtime_checkable
class Objective(Protocol):
    """The loss of an estimator on a batch."""

    def loss(self, estimator: Any, batch: Batch, rng: torch.Generator) -> Tensor:
        """A scalar to minimise; `rng` is on the CPU."""
        ...


@dataclass(frozen=True)
class RatioSamples:
    """Log-ratios on the joint distribution and on the product of marginals, one row per scene.

    Attributes:
        joint, joint_weight: (b, k).
        marginal, marginal_weight: (b, m), the condition of the row with hands of other scenes.
    """

    joint: Float[Tensor, "b k"]
    joint_weight: Float[Tensor, "b k"]
    marginal: Float[Tensor, "b m"]
    marginal_weight: Float[Tensor, "b m"]

    def loss(self, config: LossConfig) -> Float[Tensor, ""]:
        """The configured criterion."""
        joint, marginal = self.joint.float(), self.marginal.float()
        if config.criterion == "nre-a":
            return nre_a(joint, self.joint_weight, marginal, self.marginal_weight)
        if config.criterion == "balanced":
            return balanced_nre(joint, self.joint_weight, marginal, self.marginal_weight, config.balance)
        return nre_c(joint, self.joint_weight, marginal, self.marginal_weight, config.gamma)


@dataclass(frozen=True)
class SuccessObjective:
    """Cross-entropy of S for the estimators of p(S = 1 | ., h), and of holding for those that have an output for it.

    "Held" is a label of every hand, 0 where the object was not even lifted, so p(held | i, h) is learned directly.

    Attributes:
        emphasis: Successes weigh this much more in the loss; the logit is corrected for it, so the minimiser stays.
    """

    emphasis: float = 4.0

    def __post_init__(self) -> None:
        if self.emphasis <= 0:
            raise InvalidConfigurationError(f"emphasis must be positive, got {self.emphasis}")

    def loss(self, estimator: Any, batch: Batch, rng: torch.Generator) -> Tensor:
        """Loss of a `success` or `full` estimator."""
        if getattr(estimator, "held", None) is None:
            return self.cross_entropy(self.logit(estimator, batch), batch.success, batch)
        success, held = estimator.both(estimator.encode(batch.images), batch.hands)
        return self.cross_entropy(success, batch.success, batch) + self.cross_entropy(held, batch.held, batch)

    def logit(self, estimator: Any, batch: Batch) -> Tensor:
        """Logits of p(S=1 | i, h), (b, k)."""
        value: Tensor = estimator(estimator.encode(batch.images), batch.hands)
        return value

    def cross_entropy(
        self, logit: Float[Tensor, "b k"], label: Float[Tensor, "b k"], batch: Batch
    ) -> Float[Tensor, ""]:
        """Emphasised cross-entropy, given the logits of p(label = 1 | ., h)."""
        weight = batch.selection_weight * (1.0 + (self.emphasis - 1.0) * label)
        return success_loss(logit.float() + math.log(self.emphasis), label, weight)


@dataclass(frozen=True)
class FullObjective(SuccessObjective):
    """The same for the estimator that is told O, p_O, beta and mu."""

    def logit(self, estimator: Any, batch: Batch) -> Tensor:
        """Logits of p(S=1 | O, p_O, beta, mu, h), (b, k)."""
        state = ObjectState(batch.object_index, batch.scale, batch.object_pose, batch.friction)
        value: Tensor = estimator(state, batch.hands)
        return value


@dataclass(frozen=True)
class HandSuccessObjective(SuccessObjective):
    """The same for the estimator that is told nothing but the hand."""

    def logit(self, estimator: Any, batch: Batch) -> Tensor:
        """Logits of p(S=1 | h), (b, k)."""
        value: Tensor = estimator.logit(batch.hands)
        return value


@dataclass(frozen=True)
class RatioObjective:
    """A likelihood-to-evidence ratio, learned from samples of the joint density and of the product of marginals.

    Attributes:
        criterion: The loss.
    """

    criterion: LossConfig = field(default_factory=LossConfig)

    def samples(self, estimator: Any, batch: Batch, rng: torch.Generator) -> RatioSamples:
        """Log-ratios of the estimator on both."""
        raise NotImplementedError

    def loss(self, estimator: Any, batch: Batch, rng: torch.Generator) -> Tensor:
        """The criterion on `samples`."""
        return self.samples(estimator, batch, rng).loss(self.criterion)


@dataclass(frozen=True)
class SuccessRatioObjective(RatioObjective):
    """d_phi: (S, h) from the joint distribution against p(S) p(h), S balanced in both."""

    def samples(self, estimator: Any, batch: Batch, rng: torch.Generator) -> RatioSamples:
        """Rows S = 0 and S = 1 of `SuccessRatio`."""
        return success_ratio_samples(estimator, batch)


@dataclass(frozen=True)
class ImageObjective(RatioObjective):
    """d_theta: (i, h) from p(i, h | S=1) against p(i | S=1) p(h | S=1).

    Attributes:
        hands: Successful hands taken from each scene.
        shifts: Other scenes whose hands each image meets.
    """

    hands: int = 32
    shifts: int = 2

    def __post_init__(self) -> None:
        if self.hands < 1 or self.shifts < 1:
            raise InvalidConfigurationError(f"hands and shifts must be positive, got {self.hands} and {self.shifts}")

    def samples(self, estimator: Any, batch: Batch, rng: torch.Generator) -> RatioSamples:
        """Rows of scenes, of `ImageRatio`."""
        return image_samples(estimator, batch, self.hands, self.shifts, rng)


@dataclass(frozen=True)
class JointObjective(RatioObjective):
    """One ratio over (S, i): the ablation.

    Attributes:
        shifts: Other scenes whose hands each (S, image) meets.
    """

    shifts: int = 1

    def samples(self, estimator: Any, batch: Batch, rng: torch.Generator) -> RatioSamples:
        """Rows of scenes, of `JointRatio`."""
        context = estimator.encode(batch.images)
        joint = estimator(context, batch.hands, batch.success)
        others = shifted(batch.hands, batch.weight, self.shifts, rng)
        success, weight = (x.repeat(1, self.shifts) for x in (batch.success, batch.weight))
        marginal = estimator(context, others[0], success)
        return RatioSamples(joint, batch.weight, marginal, weight * others[1])


def success_ratio_samples(estimator: Any, batch: Batch) -> RatioSamples:
    """Rows S = 0 and S = 1: d_phi on p(h | S) and on p(h), each class of S with total weight 1."""
    hands = Hands(*(x.flatten(0, 1) for x in (batch.hands.position, batch.hands.rotation, batch.hands.grasp_type)))
    success, weight = batch.success.flatten(), batch.weight.flatten()
    rows = torch.stack([torch.zeros_like(success), torch.ones_like(success)])
    values = torch.stack([estimator(row, hands) for row in rows])
    joint = weight * (success == rows)
    total = joint.sum(-1, keepdim=True)
    present = (total > 0).to(weight.dtype)
    tiny = torch.finfo(weight.dtype).tiny
    marginal = present * weight / weight.sum().clamp_min(tiny)
    return RatioSamples(values, joint / total.clamp_min(tiny), values, marginal)


def image_samples(estimator: Any, batch: Batch, hands: int, shifts: int, rng: torch.Generator) -> RatioSamples:
    """d_theta on successful pairs (i, h), and on images with the successful hands of other scenes."""
    chosen, weight = successes(batch, hands)
    context = estimator.encode(batch.images)
    others, other_weight = shifted(chosen, weight, shifts, rng)
    # p(i | S=1) is not p(i): a scene counts as often as it has successes.
    scene = weight.sum(-1, keepdim=True)
    return RatioSamples(estimator(context, chosen), weight, estimator(context, others), scene * other_weight)


def successes(batch: Batch, count: int) -> tuple[Hands, Float[Tensor, "b n"]]:
    """The first successful hands of each scene and their weights; where there are fewer, failures of weight 0."""
    score = batch.success * (batch.weight > 0)
    order = score.sort(dim=-1, descending=True, stable=True).indices[:, :count]
    rows = torch.arange(len(order), device=order.device)[:, None]
    kept = (score * batch.weight)[rows, order]
    # What is left out must still count, or scenes with many successes would count too little.
    total = (score * batch.weight).sum(-1, keepdim=True)
    scale = total / kept.sum(-1, keepdim=True).clamp_min(torch.finfo(kept.dtype).tiny)
    return batch.hands[rows, order], kept * torch.where(total > 0, scale, torch.zeros_like(scale))


def shifted(
    hands: Hands, weight: Float[Tensor, "b k"], shifts: int, rng: torch.Generator
) -> tuple[Hands, Float[Tensor, "b m"]]:
    """For each scene, the hands and weights of `shifts` other scenes, or of all others if there are fewer.

    Raises:
        InvalidConfigurationError: The batch has a single scene.
    """
    scenes = len(weight)
    if scenes < 2:
        raise InvalidConfigurationError("a product of marginals needs at least two scenes in a batch")
    steps = (torch.randperm(scenes - 1, generator=rng)[:shifts] + 1).tolist()
    fields = (hands.position, hands.rotation, hands.grasp_type, weight)
    position, rotation, grasp_type, weights = (torch.cat([x.roll(s, 0) for s in steps], 1) for x in fields)
    return Hands(position, rotation, grasp_type), weights
