"""The ratio estimators of the paper (section 3.1), and p(S = 1 | i, h) on the same image encoder.

    success_ratio  f(S, h)                  log r(S | h), d_phi: two fully connected layers
    image          f(i, h)                  log r(i | S=1, h), d_theta: encoder, then two fully connected layers
    joint          f(S, i, h)               log r(S, i | h) as one network: the ablation that the paper argues against
    success        f(i, h)                  logit of p(S=1 | i, h), whose posterior is the same (`docs/method.md`)
    full           f(O, p_O, beta, mu, h)   logit of p(S=1 | O, p_O, beta, mu, h), the ideal rows of the paper's table

`local.py` has a second architecture for ``success``. An image estimator is used in two steps, so that one encoding
serves thousands of hands: ``context = estimator.encode(images)``, ``estimator(context, hands)``.
Contexts have shape (b, ...), hands (b, k), values (b, k).
"""

from dataclasses import dataclass, field

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.ratio.layers import ACTIVATIONS, Activation, ConvConfig, ConvEncoder, HandConfig, HandFeatures, mlp
from bayesgrasp.types import Hands


@dataclass(frozen=True)
class SuccessRatioConfig:
    """Configuration of `SuccessRatio`.

    Attributes:
        hand: The hand as a vector.
        widths: Widths of the hidden layers; with the output they are the paper's two layers and one number.
        activation: Of the hidden layers; the paper does not say.
    """

    hand: HandConfig = field(default_factory=HandConfig)
    widths: tuple[int, ...] = (128, 128)
    activation: Activation = "silu"

    def __post_init__(self) -> None:
        check_head(self.widths, self.activation)


class SuccessRatio(nn.Module):
    """d_phi: log r(S | h) = log p(S | h) - log p(S)."""

    def __init__(self, config: SuccessRatioConfig) -> None:
        super().__init__()
        self.config = config
        self.features = HandFeatures(config.hand)
        self.head = mlp((config.hand.width + 1, *config.widths, 1), config.activation)

    def forward(self, success: Float[Tensor, "*batch"], hands: Hands) -> Float[Tensor, "*batch"]:
        """Log-ratio of S (0 or 1) and hands of the same batch shape."""
        value: Tensor = self.head(torch.cat([self.features(hands), 2.0 * success[..., None] - 1.0], -1))
        return value.squeeze(-1)


@dataclass(frozen=True)
class ImageConfig:
    """Configuration of the estimators on one global image vector.

    Attributes:
        hand: The hand as a vector.
        encoder: The image encoder.
        widths: Widths of the hidden layers of the head.
        activation: Of these layers; the paper does not say.
    """

    hand: HandConfig = field(default_factory=HandConfig)
    encoder: ConvConfig = field(default_factory=ConvConfig)
    widths: tuple[int, ...] = (256, 256)
    activation: Activation = "silu"

    def __post_init__(self) -> None:
        check_head(self.widths, self.activation)


class _OnImage(nn.Module):
    """Encoder, then a head on (image vector, extra inputs, hand vector)."""

    extra = 0

    def __init__(self, config: ImageConfig) -> None:
        super().__init__()
        self.config = config
        self.features = HandFeatures(config.hand)
        self.encoder = ConvEncoder(config.encoder)
        # The first layer in two parts: the image's share is computed once for all its hands.
        self.from_image = nn.Linear(config.encoder.width, config.widths[0], bias=False)
        self.head = mlp((config.hand.width + self.extra, *config.widths, 1), config.activation)

    def encode(self, images: Float[Tensor, "b 1 height width"]) -> Float[Tensor, "b features"]:
        """The image's share of the first layer."""
        context: Tensor = self.from_image(self.encoder(images))
        return context

    def score(self, context: Float[Tensor, "b features"], inputs: Float[Tensor, "b k n"]) -> Float[Tensor, "b k"]:
        """The head on hand vectors and whatever stands beside them."""
        first, *rest = self.head
        hidden: Tensor = first(inputs) + context[:, None]
        for layer in rest:
            hidden = layer(hidden)
        return hidden.squeeze(-1)


class ImageRatio(_OnImage):
    """d_theta: log r(i | S=1, h) = log p(i | S=1, h) - log p(i | S=1)."""

    def forward(self, context: Float[Tensor, "b features"], hands: Hands) -> Float[Tensor, "b k"]:
        """Log-ratio of each image with each of its hands."""
        return self.score(context, self.features(hands))


class GlobalSuccess(_OnImage):
    """Logit of p(S = 1 | i, h) on one global image vector."""

    def forward(self, context: Float[Tensor, "b features"], hands: Hands) -> Float[Tensor, "b k"]:
        """Logit for each image with each of its hands."""
        return self.score(context, self.features(hands))


class JointRatio(_OnImage):
    """log r(S, i | h) in one network."""

    extra = 1

    def forward(
        self, context: Float[Tensor, "b features"], hands: Hands, success: Float[Tensor, "b k"]
    ) -> Float[Tensor, "b k"]:
        """Log-ratio of each image and S (0 or 1) with each of its hands."""
        return self.score(context, torch.cat([self.features(hands), 2.0 * success[..., None] - 1.0], -1))


@dataclass(frozen=True)
class FullConfig:
    """Configuration of `FullSuccess`.

    Attributes:
        hand: The hand as a vector.
        objects: Number of meshes.
        embedding: Length of the embedding of the mesh.
        widths: Widths of the hidden layers.
        octaves: Sines and cosines of the place in the object's frame, at wavelengths of 42 cm, 21 cm, ...; so many.
        modulated: Each mesh scales and shifts the first hidden layer, beside its embedding.
    """

    hand: HandConfig = field(default_factory=lambda: HandConfig(embedding=4))
    objects: int = 24
    embedding: int = 32
    widths: tuple[int, ...] = (256, 256, 128)
    octaves: int = 0
    modulated: bool = False

    def __post_init__(self) -> None:
        check_head(self.widths)
        if self.objects < 1 or self.embedding < 1 or self.octaves < 0:
            raise InvalidConfigurationError(f"need objects and embedding >= 1 and octaves >= 0, got {self}")


@dataclass(frozen=True)
class ObjectState:
    """What the full-observation estimator is told about each scene.

    Attributes:
        index: Mesh.
        scale: beta.
        pose: (x, y, yaw), metres and radians.
        friction: Lateral friction coefficient of each attempt.
    """

    index: Int[Tensor, "b"]
    scale: Float[Tensor, "b"]
    pose: Float[Tensor, "b 3"]
    friction: Float[Tensor, "b k"]


class FullSuccess(nn.Module):
    """Logit of p(S = 1 | O, p_O, beta, mu, h).

    It sees the hand in the world frame (reachability) and in the object's own frame, at scale 1 (contact), since O and
    p_O are known. What a centimetre changes differs from mesh to mesh: hence waves of the place, and a first layer that
    the mesh modulates (FiLM, Perez et al. 2018).
    """

    def __init__(self, config: FullConfig) -> None:
        super().__init__()
        self.config = config
        self.features = HandFeatures(config.hand)
        self.embedding = nn.Embedding(config.objects, config.embedding)
        self.modulation = nn.Embedding(config.objects, 2 * config.widths[0]) if config.modulated else None
        if self.modulation is not None:
            nn.init.zeros_(self.modulation.weight)
        width = config.hand.width + 12 + 6 * config.octaves + config.embedding + 2
        self.head = mlp((width, *config.widths, 1))

    def forward(self, state: ObjectState, hands: Hands) -> Float[Tensor, "b k"]:
        """Logit for each scene with each of its hands."""
        known = torch.stack([(state.scale[:, None] - 1.0).expand_as(state.friction) * 10.0, state.friction], -1)
        mesh = self.embedding(state.index)[:, None].expand(*hands.shape, -1)
        relative = in_object_frame(state, hands)
        parts = [self.features(hands), relative, *waves(relative[..., :3], self.config.octaves), mesh, known]
        first, *rest = self.head
        hidden: Tensor = first(torch.cat(parts, -1))
        if self.modulation is not None:
            scale, shift = self.modulation(state.index)[:, None].chunk(2, -1)
            hidden = hidden * (1.0 + scale) + shift
        for layer in rest:
            hidden = layer(hidden)
        return hidden.squeeze(-1)


def waves(place: Float[Tensor, "b k 3"], octaves: int) -> list[Float[Tensor, "b k 3"]]:
    """Sines and cosines of a place in decimetres, the first with a wavelength of 42 cm, each next with half of it."""
    phases = [1.5 * 2.0**octave * place for octave in range(octaves)]
    return [wave for phase in phases for wave in (phase.sin(), phase.cos())]


def in_object_frame(state: ObjectState, hands: Hands) -> Float[Tensor, "b k 12"]:
    """Position (decimetres, over beta) and flattened rotation of the hands in the object frame."""
    x, y, yaw = state.pose.unbind(-1)
    zero, one = torch.zeros_like(yaw), torch.ones_like(yaw)
    rows = (yaw.cos(), yaw.sin(), zero, -yaw.sin(), yaw.cos(), zero, zero, zero, one)
    world_to_object = torch.stack(rows, -1).reshape(-1, 1, 3, 3)
    offset = hands.position - torch.stack([x, y, zero], -1)[:, None]
    position = (world_to_object @ offset[..., None]).squeeze(-1) / state.scale[:, None, None]
    return torch.cat([position * 10.0, (world_to_object @ hands.rotation).flatten(-2)], -1)


def check_head(widths: tuple[int, ...], activation: str = "silu") -> None:
    """Refuse an empty list of layers, an empty layer, or an unknown activation.

    Raises:
        InvalidConfigurationError: As said.
    """
    if not widths or min(widths) < 1:
        raise InvalidConfigurationError(f"widths must be one or more positive numbers, got {widths}")
    if activation not in ACTIVATIONS:
        raise InvalidConfigurationError(f"activation must be one of {', '.join(ACTIVATIONS)}, got {activation!r}")
