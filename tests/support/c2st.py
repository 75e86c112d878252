"""Classifier two-sample test (Lopez-Paz and Oquab 2017): can a classifier tell two sets of hands apart?

Held-out accuracy by cross-validation: 0.5 if the sets come from one distribution, 1 if they never meet. The classifier
is a small network on (x, R, g), standardised; it draws from its own generator.
"""

from dataclasses import dataclass

import torch
import torch.nn.functional as F  # noqa: N812
from jaxtyping import Float, Int
from torch import Tensor, nn

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.types import GraspType, Hands


@dataclass(frozen=True)
class C2STConfig:
    """The classifier.

    Attributes:
        folds: Of the cross-validation.
        width: Of both hidden layers.
        steps: Full-batch Adam steps per fold.
        weight_decay: Against memorising small sets.
    """

    folds: int = 5
    width: int = 32
    steps: int = 150
    weight_decay: float = 1e-2

    def __post_init__(self) -> None:
        if self.folds < 2 or self.width < 1 or self.steps < 1:
            raise InvalidConfigurationError(f"need folds >= 2, width >= 1 and steps >= 1, got {self}")


def c2st(first: Hands, second: Hands, rng: torch.Generator, config: C2STConfig | None = None) -> float:
    """Held-out accuracy of telling two sets of hands apart.

    Args:
        first: Hands of batch shape (n,).
        second: Hands of batch shape (m,); the larger set is cut to the size of the other.
        rng: Splits the folds and starts the classifiers.
        config: See `C2STConfig`.

    Raises:
        InvalidConfigurationError: Fewer than ten hands in a set.
    """
    config = C2STConfig() if config is None else config
    size = min(len(first.grasp_type), len(second.grasp_type))
    if size < 10:
        raise InvalidConfigurationError(f"a two-sample test needs ten hands in each set, got {size}")
    inputs = torch.cat([_vector(first[:size]), _vector(second[:size])])
    inputs = (inputs - inputs.mean(0)) / inputs.std(0).clamp_min(1e-6)
    labels = torch.cat([torch.zeros(size), torch.ones(size)])
    order = torch.randperm(2 * size, generator=rng)
    folds = order.chunk(config.folds)
    correct = sum(_fold(inputs, labels, folds, i, rng, config) for i in range(config.folds))
    return correct / (2 * size)


def _fold(
    inputs: Float[Tensor, "n d"],
    labels: Float[Tensor, "n"],
    folds: tuple[Int[Tensor, "_"], ...],
    held_out: int,
    rng: torch.Generator,
    config: C2STConfig,
) -> int:
    """Number of correct answers on one fold after training on the others."""
    train = torch.cat([fold for i, fold in enumerate(folds) if i != held_out])
    network = _network(inputs.shape[1], config.width, rng)
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-2, weight_decay=config.weight_decay)
    for _ in range(config.steps):
        loss = F.binary_cross_entropy_with_logits(network(inputs[train]).squeeze(-1), labels[train])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    with torch.no_grad():
        answer = network(inputs[folds[held_out]]).squeeze(-1) > 0
    return int((answer == labels[folds[held_out]].bool()).sum())


def _network(inputs: int, width: int, rng: torch.Generator) -> nn.Sequential:
    with torch.random.fork_rng(devices=[]):  # the caller's random state stays as it is
        network = nn.Sequential(
            nn.Linear(inputs, width), nn.SiLU(), nn.Linear(width, width), nn.SiLU(), nn.Linear(width, 1)
        )
    for layer in network:
        if isinstance(layer, nn.Linear):
            nn.init.normal_(layer.weight, std=layer.in_features**-0.5, generator=rng)
            nn.init.zeros_(layer.bias)
    return network


def _vector(hands: Hands) -> Float[Tensor, "n d"]:
    types = F.one_hot(hands.grasp_type, len(GraspType)).to(hands.position.dtype)
    return torch.cat([hands.position, hands.rotation.flatten(-2), types], -1).float()
