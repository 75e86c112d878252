"""The parts shared by all estimators: fully connected layers, the hand as a vector, the depth image as a vector.

The hand enters as in the paper's figure: position, flattened rotation matrix (continuous on SO(3), and the same for
q and -q; Zhou et al. 2019) and an embedding of the type, 3 + 9 + 1 = 13 numbers. Positions are first scaled so that
the support of the prior becomes [-1, 1]^3.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import IMAGE_SHAPE
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.types import GraspType, Hands

Activation = Literal["silu", "relu"]
ACTIVATIONS: dict[Activation, type[nn.Module]] = {"silu": nn.SiLU, "relu": nn.ReLU}

_PRIOR = GraspPrior()


@dataclass(frozen=True)
class HandConfig:
    """How a hand becomes a vector.

    Attributes:
        low: Lower corner of the prior's support, metres, world frame.
        high: Upper corner.
        embedding: Length of the embedding of the grasp type (1 in the paper).
    """

    low: tuple[float, float, float] = _PRIOR.low
    high: tuple[float, float, float] = _PRIOR.high
    embedding: int = 1

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.low, self.high, strict=True)):
            raise InvalidConfigurationError(f"the hand box needs low < high, got {self.low} and {self.high}")
        if self.embedding < 1:
            raise InvalidConfigurationError(f"embedding must be at least 1, got {self.embedding}")

    @property
    def width(self) -> int:
        """Length of the vector."""
        return 12 + self.embedding


class HandFeatures(nn.Module):
    """(x, R, g) as a vector of `HandConfig.width` numbers."""

    center: Tensor
    reach: Tensor

    def __init__(self, config: HandConfig) -> None:
        super().__init__()
        low, high = torch.tensor(config.low), torch.tensor(config.high)
        self.register_buffer("center", (high + low) / 2, persistent=False)
        self.register_buffer("reach", (high - low) / 2, persistent=False)
        self.embedding = nn.Embedding(len(GraspType), config.embedding)

    def forward(self, hands: Hands) -> Float[Tensor, "*batch width"]:
        """Features of hands of any batch shape."""
        position = (hands.position - self.center) / self.reach
        return torch.cat([position, hands.rotation.flatten(-2), self.embedding(hands.grasp_type)], -1)


@dataclass(frozen=True)
class ConvConfig:
    """The paper's image encoder: four convolutions and one fully connected layer; widths are ours.

    Attributes:
        image_shape: Height and width of the input, pixels.
        channels: Output channels of the convolutions, each 3x3 with stride 2.
        width: Length of the image vector.
    """

    image_shape: tuple[int, int] = IMAGE_SHAPE
    channels: tuple[int, ...] = (16, 32, 64, 64)
    width: int = 128

    def __post_init__(self) -> None:
        if not self.channels or min(*self.channels, *self.image_shape, self.width) < 1:
            raise InvalidConfigurationError(f"channels, image_shape and width must be positive, got {self}")


class ConvEncoder(nn.Module):
    """Depth image -> vector. Convolution, batch norm and ReLU per stage, then one fully connected layer."""

    def __init__(self, config: ConvConfig) -> None:
        super().__init__()
        self.stages = nn.Sequential(
            *(conv_stage(a, b) for a, b in zip((1, *config.channels), config.channels, strict=False))
        )
        height, width = (-(-size // 2 ** len(config.channels)) for size in config.image_shape)
        self.output = nn.Sequential(nn.Linear(config.channels[-1] * height * width, config.width), nn.ReLU())
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, images: Float[Tensor, "b 1 height width"]) -> Float[Tensor, "b features"]:
        """Encode images in metres, 0 = no return."""
        # Centred on the table's depth, in decimetres; "no return" keeps a value of its own.
        centred = torch.where(images > 0, (images - 0.75) * 10.0, torch.full_like(images, -5.0))
        stages = self.stages(centred.contiguous(memory_format=torch.channels_last))
        vector: Tensor = self.output(stages.flatten(1))
        return vector


def conv_stage(inputs: int, outputs: int, stride: int = 2) -> nn.Sequential:
    """3x3 convolution, batch norm, ReLU."""
    convolution = nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


def mlp(sizes: Sequence[int], activation: Activation = "silu") -> nn.Sequential:
    """Fully connected layers of the given sizes.

    SiLU is smooth, for a posterior that is climbed by gradients. ReLU learns a posterior of several modes in fewer
    steps: SiLU is nearly linear near 0, where its inputs start.
    """
    layers: list[nn.Module] = []
    for inputs, outputs in itertools.pairwise(sizes):
        layers += [nn.Linear(inputs, outputs), ACTIVATIONS[activation]()]
    return nn.Sequential(*layers[:-1])
