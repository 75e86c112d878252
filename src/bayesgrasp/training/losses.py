r"""Criteria whose minimiser is a likelihood-to-evidence ratio, on weighted samples.

With log-ratios f on samples of the joint distribution (a) and of the product of marginals (b):

    NRE-A (paper, eq. 4; Hermans et al. 2020)     E_a softplus(-f) + E_b softplus(f)
    balanced NRE (Delaunoy et al. 2022)           the same + lambda (E_a sigmoid(f) + E_b sigmoid(f) - 1)^2
    NRE-C (Miller et al. 2022)                    classification among K marginal draws and "none of them is joint"

Each is minimal at f = log r. NRE-B (Durkan et al. 2020) is left out: its minimiser is log r plus any function of the
condition, so neither its value nor its ratio between images means anything.

Success itself is learned by cross-entropy, whose minimiser is the logit of p(S = 1 | .) under the weights.
Every mean is a weighted mean: sum(w x) / sum(w).
"""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import torch
import torch.nn.functional as F  # noqa: N812
from jaxtyping import Float
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError

Criterion = Literal["nre-a", "balanced", "nre-c"]
CRITERIA: tuple[Criterion, ...] = get_args(Criterion)


@dataclass(frozen=True)
class LossConfig:
    """Which criterion trains a ratio.

    Attributes:
        criterion: ``nre-a``, ``balanced`` or ``nre-c``.
        balance: lambda of balanced NRE.
        gamma: Prior odds of "some draw is joint" in NRE-C.
    """

    criterion: str = "nre-a"
    balance: float = 100.0
    gamma: float = 1.0

    def __post_init__(self) -> None:
        if self.criterion not in CRITERIA:
            raise InvalidConfigurationError(f"criterion must be one of {', '.join(CRITERIA)}, got {self.criterion!r}")
        if self.balance < 0 or self.gamma <= 0:
            raise InvalidConfigurationError(
                f"need balance >= 0 and gamma > 0, got balance={self.balance}, gamma={self.gamma}"
            )


def weighted_mean(values: Float[Tensor, "*n"], weight: Float[Tensor, "*n"]) -> Float[Tensor, ""]:
    """sum(w x) / sum(w); 0 where all weights are 0."""
    return (values * weight).sum() / weight.sum().clamp_min(torch.finfo(weight.dtype).tiny)


def success_loss(
    logit: Float[Tensor, "*n"], success: Float[Tensor, "*n"], weight: Float[Tensor, "*n"]
) -> Float[Tensor, ""]:
    """Weighted binary cross-entropy of S against sigmoid(logit)."""
    return weighted_mean(F.binary_cross_entropy_with_logits(logit, success, reduction="none"), weight)


def nre_a(
    joint: Float[Tensor, "*n"],
    joint_weight: Float[Tensor, "*n"],
    marginal: Float[Tensor, "*m"],
    marginal_weight: Float[Tensor, "*m"],
) -> Float[Tensor, ""]:
    """Binary cross-entropy between joint and marginal samples, given their log-ratios."""
    return weighted_mean(F.softplus(-joint), joint_weight) + weighted_mean(F.softplus(marginal), marginal_weight)


def imbalance(
    joint: Float[Tensor, "*n"],
    joint_weight: Float[Tensor, "*n"],
    marginal: Float[Tensor, "*m"],
    marginal_weight: Float[Tensor, "*m"],
) -> Float[Tensor, ""]:
    """E_a d + E_b d - 1 for the classifier d = sigmoid(f): 0 for a balanced one, as the optimal one is."""
    means = weighted_mean(joint.sigmoid(), joint_weight) + weighted_mean(marginal.sigmoid(), marginal_weight)
    return means - 1.0


def balanced_nre(
    joint: Float[Tensor, "*n"],
    joint_weight: Float[Tensor, "*n"],
    marginal: Float[Tensor, "*m"],
    marginal_weight: Float[Tensor, "*m"],
    strength: float,
) -> Float[Tensor, ""]:
    """NRE-A and the squared imbalance, which makes the posterior conservative rather than overconfident."""
    penalty = imbalance(joint, joint_weight, marginal, marginal_weight).square()
    return nre_a(joint, joint_weight, marginal, marginal_weight) + strength * penalty


def nre_c(
    joint: Float[Tensor, "b k"],
    joint_weight: Float[Tensor, "b k"],
    marginal: Float[Tensor, "b m"],
    marginal_weight: Float[Tensor, "b m"],
    gamma: float,
) -> Float[Tensor, ""]:
    """Contrastive loss: M hands for one condition, one of which is joint, or none.

    "None" is all M marginal draws of the row; each joint draw takes the place of the first of them. A weighted
    marginal draw counts as often as its weight says; with equal weights the minimiser is exact.

    Args:
        joint: Log-ratios of joint draws for the condition of the row.
        joint_weight: Their weights.
        marginal: Log-ratios of M >= 2 independent draws for the condition of the row.
        marginal_weight: Their weights; only their proportions within the row matter.
        gamma: Prior odds of "one of the draws is joint".
    """
    none = torch.full_like(joint[:, :1], math.log(marginal.shape[-1]))
    log_gamma = math.log(gamma)
    log_none = none - torch.logaddexp(none, log_gamma + _log_sum(marginal, marginal_weight))
    others = torch.logaddexp(none, log_gamma + _log_sum(marginal[:, 1:], marginal_weight[:, 1:]))
    log_joint = joint + log_gamma - torch.logaddexp(joint + log_gamma, others)
    return -weighted_mean(log_none + gamma * log_joint, joint_weight) / (1.0 + gamma)


def _log_sum(values: Float[Tensor, "b m"], weight: Float[Tensor, "b m"]) -> Float[Tensor, "b 1"]:
    """Log of the sum of exp(values), as if each of the m draws occurred in proportion to its weight."""
    tiny = torch.finfo(values.dtype).tiny
    share = weight / weight.sum(-1, keepdim=True).clamp_min(tiny)
    total: Tensor = torch.logsumexp(values + share.clamp_min(tiny).log(), -1, keepdim=True)
    return total + math.log(values.shape[-1])
