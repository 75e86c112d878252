r"""p(S = 1 | h), the probability that a hand succeeds in a scene of which nothing is known, and its r(S | h).

    log r(S | h) = log p(S | h) - log p(S),       p(S = 1 | h) = sigmoid(f(h))

d_phi of the paper learns the ratio itself, for S = 0 and S = 1 in one network, and must do it on draws from p(h): its
second class is p(S) p(h). The probability is learned by cross-entropy from hands of *any* law that does not look at
the scene, so the best hands, of which the prior draws a few in a million, can be tried as often as it takes
(`generation.blind_practice`). p(S = 1) is a number, the share of successes under the prior.
"""

import math
from dataclasses import dataclass, field

import torch.nn.functional as F  # noqa: N812
from jaxtyping import Float
from torch import Tensor, nn

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.ratio.estimators import check_head
from bayesgrasp.ratio.layers import Activation, HandConfig, HandFeatures, mlp
from bayesgrasp.types import Hands


@dataclass(frozen=True)
class HandSuccessConfig:
    """Configuration of `HandSuccess`.

    Attributes:
        hand: The hand as a vector.
        widths: Widths of the hidden layers.
        activation: Of the hidden layers. Success ends abruptly where the fingers would reach the table: ReLU learns
            such an edge in fewer steps than SiLU.
        success_rate: p(S=1) under the prior.

    Raises:
        InvalidConfigurationError: The rate is not strictly between 0 and 1.
    """

    hand: HandConfig = field(default_factory=HandConfig)
    widths: tuple[int, ...] = (128, 128, 128)
    activation: Activation = "relu"
    success_rate: float = 0.01

    def __post_init__(self) -> None:
        check_head(self.widths, self.activation)
        if not 0 < self.success_rate < 1:
            raise InvalidConfigurationError(f"success_rate must be between 0 and 1, got {self.success_rate}")


class HandSuccess(nn.Module):
    """log r(S | h) by way of the logit of p(S=1 | h)."""

    def __init__(self, config: HandSuccessConfig) -> None:
        super().__init__()
        self.config = config
        self.features = HandFeatures(config.hand)
        self.head = mlp((config.hand.width, *config.widths, 1), config.activation)

    def logit(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Logit of p(S=1 | h) for hands of any batch shape."""
        value: Tensor = self.head(self.features(hands))
        return value.squeeze(-1)

    def forward(self, success: Float[Tensor, "*batch"], hands: Hands) -> Float[Tensor, "*batch"]:
        """Log-ratio of S (0 or 1) and hands of the same batch shape."""
        sign = 2.0 * success - 1.0
        log_failure, log_success = math.log1p(-self.config.success_rate), math.log(self.config.success_rate)
        marginal = log_failure + success * (log_success - log_failure)
        return F.logsigmoid(sign * self.logit(hands)) - marginal
