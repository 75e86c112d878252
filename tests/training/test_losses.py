"""Every criterion must be minimal at the log-ratio it claims, and a weight must count as repetition."""

import math

import pytest
import torch
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.training.losses import LossConfig, balanced_nre, imbalance, nre_a, nre_c, success_loss, weighted_mean

JOINT = torch.tensor([[0.30, 0.05, 0.05], [0.05, 0.10, 0.45]], dtype=torch.float64)
"""p(i, h) on two images and three hands."""
MARGINAL = JOINT.sum(1, keepdim=True) * JOINT.sum(0, keepdim=True)
LOG_RATIO = (JOINT / MARGINAL).log()


def criterion(name: str, f: Tensor) -> Tensor:
    """The exact risk on the tabular problem: every pair once, weighted by its probability."""
    if name == "nre-a":
        return nre_a(f, JOINT, f, MARGINAL)
    if name == "balanced":
        return balanced_nre(f, JOINT, f, MARGINAL, 100.0)
    return contrastive_risk(f)


def contrastive_risk(f: Tensor, gamma: float = 2.0) -> Tensor:
    """NRE-C's risk with two draws: for each image, all pairs of hands from the marginal, and each joint hand."""
    hand = JOINT.sum(0)
    total = torch.zeros((), dtype=f.dtype)
    for i in range(2):
        for a in range(3):
            for b in range(3):
                weight = (hand[a] * hand[b] * JOINT[i]).reshape(1, 3)
                draws = f[i, [a, b]].reshape(1, 2)
                row = nre_c(f[i : i + 1], weight, draws, torch.ones_like(draws), gamma)
                total = total + weight.sum() * row
    return total


@pytest.mark.parametrize("name", ["nre-a", "balanced", "nre-c"])
def test_minimiser_is_the_log_ratio(name: str) -> None:
    f = torch.zeros(2, 3, dtype=torch.float64, requires_grad=True)
    optimizer = torch.optim.LBFGS([f], max_iter=200, tolerance_grad=1e-10, line_search_fn="strong_wolfe")

    def closure() -> Tensor:
        optimizer.zero_grad()
        loss = criterion(name, f)
        loss.backward()
        return loss

    optimizer.step(closure)
    torch.testing.assert_close(f.detach(), LOG_RATIO, atol=1e-3, rtol=0)


def test_imbalance_vanishes_for_the_true_ratio_and_not_for_a_sharper_one() -> None:
    assert abs(float(imbalance(LOG_RATIO, JOINT, LOG_RATIO, MARGINAL))) < 1e-12
    assert float(imbalance(2 * LOG_RATIO + 1, JOINT, 2 * LOG_RATIO + 1, MARGINAL)) > 0.1


def test_contrastive_loss_by_hand() -> None:
    joint, marginal, gamma = torch.tensor([[0.3]]), torch.tensor([[0.7, -0.2, 0.1]]), 1.5
    r = [math.exp(x) for x in (0.7, -0.2, 0.1)]
    others = r[1] + r[2]  # the joint draw takes the place of the first
    none = -math.log(3 / (3 + gamma * sum(r)))
    hit = -math.log(gamma * math.exp(0.3) / (3 + gamma * (math.exp(0.3) + others)))
    expected = (none + gamma * hit) / (1 + gamma)
    assert float(nre_c(joint, torch.ones(1, 1), marginal, torch.ones(1, 3), gamma)) == pytest.approx(expected, 1e-5)


def test_a_draw_of_weight_zero_is_not_there() -> None:
    joint, weight = torch.tensor([[0.3, 1.0]]), torch.tensor([[1.0, 0.0]])
    marginal, marginal_weight = torch.tensor([[0.7, -0.2, 9.0]]), torch.tensor([[1.0, 1.0, 0.0]])
    changed = nre_c(
        joint + torch.tensor([0.0, 5.0]), weight, marginal.clone().fill_(0.0) + marginal, marginal_weight, 1.0
    )
    assert float(nre_c(joint, weight, marginal, marginal_weight, 1.0)) == pytest.approx(float(changed))
    other = marginal.clone()
    other[0, 2] = -9.0
    assert float(nre_c(joint, weight, other, marginal_weight, 1.0)) == pytest.approx(float(changed))


def test_a_weight_of_two_counts_twice() -> None:
    values = torch.tensor([0.1, 0.9])
    expected = torch.tensor([0.1, 0.9, 0.9]).mean()
    torch.testing.assert_close(weighted_mean(values, torch.tensor([1.0, 2.0])), expected)


def test_success_loss_is_cross_entropy() -> None:
    logit, success = torch.tensor([0.5, -1.0]), torch.tensor([1.0, 0.0])
    expected = (math.log1p(math.exp(-0.5)) + 3 * math.log1p(math.exp(-1.0))) / 4
    assert float(success_loss(logit, success, torch.tensor([1.0, 3.0]))) == pytest.approx(expected, 1e-6)


def test_no_weight_gives_zero_not_nan() -> None:
    assert float(weighted_mean(torch.ones(2), torch.zeros(2))) == 0.0


@pytest.mark.parametrize("wrong", [{"criterion": "nre-b"}, {"balance": -1.0}, {"gamma": 0.0}])
def test_invalid_configuration_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(InvalidConfigurationError, match=r"nre-a|balance|gamma"):
        LossConfig(**wrong)  # type: ignore[arg-type]
