"""The checks after training: fulfilled by the true ratios of a small problem, broken by wrong ones."""

from collections.abc import Callable

import pytest
import torch
from torch import Tensor, nn

from bayesgrasp.data.schema import Batch
from bayesgrasp.training.checks import check
from bayesgrasp.training.objectives import (
    FullObjective,
    HandSuccessObjective,
    ImageObjective,
    JointObjective,
    Objective,
    SuccessObjective,
    SuccessRatioObjective,
)
from bayesgrasp.types import Hands

Value = Callable[[Tensor, Tensor], Tensor]
GRID = torch.linspace(0, 1, 2001)


def chance(light: Tensor, x: Tensor) -> Tensor:
    """p(S=1 | i, h) of an image that is dark (0) or light (1) and a hand at x, uniform in [0, 1]."""
    return (5 * (x - 0.7) + 2 * (light - 0.5)).sigmoid()


SEEN = torch.stack([chance(torch.tensor(light), GRID).mean() for light in (0.0, 1.0)])
"""p(S=1 | i) of both images."""
RATE = SEEN.mean()


def given_hand(x: Tensor) -> Tensor:
    return (chance(torch.zeros(()), x) + chance(torch.ones(()), x)) / 2


def made(scenes: int, hands: int, seed: int) -> Batch:
    rng = torch.Generator().manual_seed(seed)
    light = torch.randint(2, (scenes,), generator=rng).float()
    x = torch.rand(scenes, hands, generator=rng)
    success = (torch.rand(scenes, hands, generator=rng) < chance(light[:, None], x)).float()
    ones, zeros = torch.ones(scenes, hands), torch.zeros(scenes, hands, 2)
    rotation = torch.eye(3).expand(scenes, hands, 3, 3)
    drawn = Hands(torch.cat([x[..., None], zeros], -1), rotation, torch.zeros(scenes, hands, dtype=torch.int64))
    images = light[:, None, None, None]
    index = torch.zeros(scenes, dtype=torch.int64)
    return Batch(
        drawn, success, ones, ones, images, index, torch.ones(scenes), light[:, None].repeat(1, 3), ones, success
    )


class Exact(nn.Module):
    """A function of image and place, in the shape that each objective expects, with an error to be found."""

    def __init__(self, role: str, error: float) -> None:
        super().__init__()
        self.role, self.error = role, error

    def encode(self, images: Tensor) -> Tensor:
        return images[:, 0, 0, 0]

    def forward(self, first: object, hands: Hands, success: Tensor | None = None) -> Tensor:
        return self.value(first, hands.position[..., 0], success) + self.error

    def logit(self, hands: Hands) -> Tensor:
        return given_hand(hands.position[..., 0]).logit() + self.error

    def value(self, first: object, x: Tensor, success: Tensor | None) -> Tensor:
        if self.role == "success_ratio":
            assert isinstance(first, Tensor)
            return torch.where(first == 1, given_hand(x) / RATE, (1 - given_hand(x)) / (1 - RATE)).log()
        if self.role == "full":
            return chance(first.pose[:, :1], x).logit()  # type: ignore[attr-defined]
        assert isinstance(first, Tensor)
        light = first[:, None]
        if self.role == "success":
            return chance(light, x).logit()
        seen = SEEN[first.long()][:, None]
        if self.role == "image":
            return (chance(light, x) * RATE / (given_hand(x) * seen)).log()
        return torch.where(success == 1, chance(light, x) / seen, (1 - chance(light, x)) / (1 - seen)).log()


OBJECTIVES: dict[str, Objective] = {
    "success_ratio": SuccessRatioObjective(),
    "image": ImageObjective(shifts=20),
    "joint": JointObjective(shifts=20),
    "success": SuccessObjective(),
    "full": FullObjective(),
    "hand_success": HandSuccessObjective(),
}


def checked(role: str, error: float) -> dict[str, float]:
    return check(Exact(role, error), OBJECTIVES[role], [made(400, 32, seed) for seed in range(3)])


@pytest.mark.parametrize("role", OBJECTIVES)
def test_the_true_ratio_fulfils_them(role: str) -> None:
    result = checked(role, 0.0)
    assert result["mean_ratio"] == pytest.approx(1.0, abs=0.03)
    assert result["balance"] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("role", OBJECTIVES)
@pytest.mark.parametrize("error", [-1.0, 1.0])
def test_a_wrong_one_breaks_them_on_its_own_side(role: str, error: float) -> None:
    result = checked(role, error)
    assert (result["mean_ratio"] - 1) * error > 0.3
    assert abs(result["balance"]) > 0.03


@pytest.mark.parametrize("role", ["success", "full", "hand_success"])
def test_a_probability_has_the_share_of_successes_as_its_mean(role: str) -> None:
    result = checked(role, 0.0)
    assert result["mean_probability"] == pytest.approx(result["mean_success"], abs=0.01)
    assert result["cross_entropy"] < checked(role, 1.0)["cross_entropy"]


class Nothing:
    """An objective that is not one of ours."""

    def loss(self, estimator: nn.Module, batch: Batch, rng: torch.Generator) -> Tensor:
        return torch.zeros(())


def test_an_unknown_objective_has_no_checks() -> None:
    assert check(nn.Identity(), Nothing(), [made(4, 4, 0)]) == {}
