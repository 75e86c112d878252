"""What must hold for the true ratios, measured on held-out scenes after training.

    balance                  E_joint d + E_marginal d - 1 = 0,     d = sigmoid(log r)
    mean of r(S=1 | h)       E_{p(h)} r(S=1 | h) = 1
    mean of r(i | S=1, h)    E_{p(i | S=1) p(h | S=1)} r(i | S=1, h) = 1
    mean of p(S=1 | .)       the weighted share of successes

They are necessary, not sufficient; whether the posterior is right is for `diagnostics`.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn

from bayesgrasp.data.schema import Batch
from bayesgrasp.ratio.losses import imbalance, weighted_mean
from bayesgrasp.ratio.objectives import (
    ImageObjective,
    MetricObjective,
    Objective,
    RatioSamples,
    SuccessObjective,
    image_samples,
    metric_samples,
)
from bayesgrasp.seeding import torch_generator


@dataclass
class _Means:
    """Weighted means by name, over batches."""

    sums: dict[str, Tensor] = field(default_factory=dict)
    weights: dict[str, Tensor] = field(default_factory=dict)

    def add(self, name: str, values: Tensor, weight: Tensor) -> None:
        total = weight.double().sum()
        self.sums[name] = self.sums.get(name, torch.zeros(())) + (values.double() * weight.double()).sum()
        self.weights[name] = self.weights.get(name, torch.zeros(())) + total

    def result(self) -> dict[str, float]:
        return {name: float(value / self.weights[name]) for name, value in self.sums.items()}


def check(estimator: nn.Module, objective: Objective, batches: Iterable[Batch], seed: int = 0) -> dict[str, float]:
    """Measure on held-out batches what the objective's true ratio fulfils; empty for an objective without checks.

    Args:
        estimator: On the CPU, in evaluation mode.
        objective: What it was trained with.
        batches: Held-out scenes.
        seed: Of the pairings.
    """
    means = _Means()
    with torch.no_grad():
        for index, batch in enumerate(batches):
            tensors = batch.to("cpu")
            _check_batch(estimator, objective, tensors, means, torch_generator(seed, index))
    return means.result()


def _check_batch(estimator: Any, objective: Objective, batch: Batch, means: _Means, rng: torch.Generator) -> None:
    if isinstance(objective, SuccessObjective):
        probability = objective.logit(estimator, batch).sigmoid()
        means.add("mean_probability", probability, batch.selection_weight)
        means.add("mean_success", batch.success, batch.selection_weight)
        loss = SuccessObjective(1.0).loss(objective.logit(estimator, batch), batch)
        means.add("cross_entropy", loss, batch.selection_weight.sum())
    elif isinstance(objective, MetricObjective):
        samples = metric_samples(estimator, batch)
        _add_ratio(samples, means)
        means.add("mean_ratio", samples.marginal[1].exp(), samples.marginal_weight[1])
    elif isinstance(objective, ImageObjective):
        samples = image_samples(estimator, batch, objective.hands, objective.shifts, rng)
        _add_ratio(samples, means)
        means.add("mean_ratio", samples.marginal.exp(), samples.marginal_weight)


def _add_ratio(samples: RatioSamples, means: _Means) -> None:
    classes = (samples.joint, samples.joint_weight, samples.marginal, samples.marginal_weight)
    means.add("balance", imbalance(*classes), samples.joint_weight.sum())
    means.add("mean_log_ratio", weighted_mean(samples.joint, samples.joint_weight), samples.joint_weight.sum())
