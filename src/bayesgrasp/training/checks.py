"""What must hold for the true ratios, measured on held-out draws after training.

    balance       E_joint d + E_marginal d - 1 = 0,     d = sigmoid(log r)
    mean_ratio    E_marginal r = 1:  E_{p(h)} r(S=1 | h) for d_phi, E_{p(i | S=1) p(h | S=1)} r(i | S=1, h) for d_theta,
                  E_{p(S, i) p(h)} r(S, i | h) for the joint one

For p(S=1 | ., h) the ratio is r = p(S=1 | ., h) / p(S=1) between p(., h | S=1) and p(.) p(h), so the mean of the
probability is the weighted share of successes.

They are necessary, not sufficient; whether the posterior is right is for `diagnostics`.
"""

from collections.abc import Iterable
from typing import Any

import torch
import torch.nn.functional as F  # noqa: N812
from jaxtyping import Float
from torch import Tensor, nn

from bayesgrasp.data.schema import Batch
from bayesgrasp.seeding import Stream, torch_generator
from bayesgrasp.training.losses import imbalance, success_loss, weighted_mean
from bayesgrasp.training.objectives import (
    Objective,
    RatioObjective,
    RatioSamples,
    SuccessObjective,
    SuccessRatioObjective,
)


def check(estimator: nn.Module, objective: Objective, batches: Iterable[Batch], seed: int = 0) -> dict[str, float]:
    """Measure on held-out batches what the objective's true ratio fulfils; empty for an objective without checks.

    Args:
        estimator: On the CPU, in evaluation mode.
        objective: What it was trained with.
        batches: Held-out scenes.
        seed: Of the pairings.
    """
    with torch.no_grad():
        if isinstance(objective, SuccessObjective):
            return _success_checks(estimator, objective, batches)
        if isinstance(objective, RatioObjective):
            return _ratio_checks(estimator, objective, batches, seed)
    return {}


def _ratio_checks(
    estimator: nn.Module, objective: RatioObjective, batches: Iterable[Batch], seed: int
) -> dict[str, float]:
    parts = [
        objective.samples(estimator, batch.to("cpu"), torch_generator(seed, Stream.CHECK, index))
        for index, batch in enumerate(batches)
    ]
    joint, joint_weight, marginal, marginal_weight = (
        torch.cat([getattr(part, name).double().flatten() for part in parts])
        for name in ("joint", "joint_weight", "marginal", "marginal_weight")
    )
    sure = [_success_row(part) for part in parts] if isinstance(objective, SuccessRatioObjective) else None
    values, weight = (marginal, marginal_weight) if sure is None else map(torch.cat, zip(*sure, strict=True))
    return {
        "balance": float(imbalance(joint, joint_weight, marginal, marginal_weight)),
        "mean_log_ratio": float(weighted_mean(joint, joint_weight)),
        "mean_ratio": float(weighted_mean(values.exp(), weight)),
    }


def _success_row(samples: RatioSamples) -> tuple[Float[Tensor, "m"], Float[Tensor, "m"]]:
    """Log r(S=1 | h) and the weights of p(h): the second row of d_phi."""
    return samples.marginal[1].double(), samples.marginal_weight[1].double()


def _success_checks(estimator: Any, objective: SuccessObjective, batches: Iterable[Batch]) -> dict[str, float]:
    parts = [
        torch.stack([objective.logit(estimator, batch).float(), batch.success, batch.weight, batch.selection_weight])
        for batch in (one.to("cpu") for one in batches)
    ]
    logit, success, weight, selection = torch.cat([part.flatten(1) for part in parts], 1).double()
    result = {
        "mean_probability": float(weighted_mean(logit.sigmoid(), selection)),
        "mean_success": float(weighted_mean(success, selection)),
        "cross_entropy": float(success_loss(logit, success, selection)),
    }
    rate = weighted_mean(success, weight)
    if rate > 0:
        log_ratio = F.logsigmoid(logit) - rate.log()
        result["mean_ratio"] = float(weighted_mean(log_ratio.exp(), weight))
        result["balance"] = float(imbalance(log_ratio, weight * success, log_ratio, weight))
    return result
