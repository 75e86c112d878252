"""p(S = 1 | i, h), and p(held | i, h), from local evidence: what the image says at points that move with the hand.

    image -> height above the table, validity, world coordinates of every pixel
          -> convolutions down to 1/16 and back up to 1/2 of the resolution -> map of C channels, and one global vector
    hand  -> points in its closing region -> signed depth against the measured surface, and against M learned
             surfaces behind it (where the object ends, unseen); learned features at the same pixels
    all   -> fully connected layers -> logit of success, and one of holding against pushes

One view shows only the front of an object, so a point behind the surface is either inside the object or in its
shadow. The learned surfaces are offsets of the measured one that the convolutions predict for each pixel; the head
sees a point's signed depth against each.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from jaxtyping import Float
from torch import Tensor, nn

from bayesgrasp.errors import CheckpointError, InvalidConfigurationError
from bayesgrasp.ratio.estimators import check_head
from bayesgrasp.ratio.evidence import HandPoints, PointsConfig, View, sample
from bayesgrasp.ratio.fused.local_head import LocalHead
from bayesgrasp.ratio.fused.look_up_kernels import Evidence, Eye
from bayesgrasp.ratio.layers import HandConfig, HandFeatures, conv_stage, mlp
from bayesgrasp.types import Hands

Window = tuple[int, int, int, int]

WORKSPACE_WINDOW: Window = (0, 40, 128, 176)
"""Where the canonical camera sees |x|, |y| <= 0.17 m and z <= 0.3 m: half of the image, for half of the work."""
OFFSET_UNIT = 0.05
"""A learned surface is this many metres behind the measured one for an output of 1."""
OFFSET_SCALE = 0.02
"""Signed depth against a learned surface is read through tanh(depth / this), metres."""


@dataclass(frozen=True)
class LocalConfig:
    """Configuration of `LocalSuccess`.

    Attributes:
        hand: The hand as a vector.
        evidence: Points attached to the hand, and the camera.
        channels: Channels of the convolutions at 1/2, 1/4, 1/8 and 1/16 of the resolution.
        surfaces: Number M of learned surfaces.
        features: Learned channels that are looked up as they are.
        every: They are looked up at every so many points, the surfaces at all of them.
        vector: Length of the global vector.
        widths: Widths of the hidden layers of the head.
        held: A second output, the logit of p(held | i, h): that the grasp also holds the object against pushes.
        window: Part of the image that the convolutions see: top, left, height, width, pixels; all of it if None. Depths
            are looked up in the whole image.
    """

    hand: HandConfig = field(default_factory=lambda: HandConfig(embedding=4))
    evidence: PointsConfig = field(default_factory=PointsConfig)
    channels: tuple[int, int, int, int] = (16, 32, 64, 96)
    surfaces: int = 3
    features: int = 8
    every: int = 3
    vector: int = 64
    widths: tuple[int, ...] = (192, 192, 96)
    window: Window | None = None
    held: bool = False

    def __post_init__(self) -> None:
        check_head(self.widths)
        (top, left, height, width), view = self.seen, self.evidence.view
        if min(top, left) < 0 or min(height, width) < 1 or top + height > view.height or left + width > view.width:
            raise InvalidConfigurationError(f"window {self.window} does not fit {view.height} x {view.width} pixels")
        if min(*self.channels, self.surfaces, self.features, self.every, self.vector) < 1:
            raise InvalidConfigurationError(f"channels, surfaces, features, every and vector must be positive: {self}")

    @property
    def seen(self) -> Window:
        """The window, the whole image where there is none."""
        return self.window or (0, 0, self.evidence.view.height, self.evidence.view.width)


class Context(NamedTuple):
    """What one image contributes to the values of all its hands."""

    depth: Tensor
    """Measured depth without gaps, (b, 1, height, width), metres."""
    maps: Tensor
    """Learned surfaces, then learned features, of the window, at half the resolution, (b, c, height / 2, width / 2)."""
    vector: Tensor
    """The image's share of the head's first layer, (b, width)."""


class LocalEncoder(nn.Module):
    """Depth image -> local maps at half the resolution, and a global vector."""

    def __init__(self, config: LocalConfig) -> None:
        super().__init__()
        self.view = View(config.evidence.view)
        c2, c4, c8, c16 = config.channels
        self.down = nn.ModuleList([conv_stage(a, b) for a, b in ((5, c2), (c2, c4), (c4, c8), (c8, c16))])
        self.deep = conv_stage(c16, c16, 1)
        self.lateral = nn.ModuleList([nn.Conv2d(a, b, 1) for a, b in ((c16, c8), (c8, c4), (c4, c2))])
        self.merge = nn.ModuleList([conv_stage(c, c, 1) for c in (c8, c4, c2)])
        self.maps = nn.Conv2d(c2, config.surfaces + config.features, 1)
        top, left, height, width = config.seen
        self.rows, self.columns = slice(top, top + height), slice(left, left + width)
        cells = -(-height // 16) * -(-width // 16)
        self.pool = nn.Conv2d(c16, 16, 1)
        self.vector = nn.Sequential(nn.Linear(16 * cells, config.vector), nn.ReLU())
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, images: Tensor, depth: Tensor) -> tuple[Tensor, Tensor]:
        """Maps of the window (b, c, height / 2, width / 2) and global vectors (b, vector)."""
        parts = [self.view.surface(depth) / 0.1, (images > 0).to(depth.dtype), (depth - 0.75) * 10.0]
        inputs = torch.cat([part[..., self.rows, self.columns] for part in parts], 1).clamp(-5.0, 5.0)
        levels = [inputs.contiguous(memory_format=torch.channels_last)]
        for stage in self.down:
            levels.append(stage(levels[-1]))
        top = levels[-1] + self.deep(levels[-1])
        vector = self.vector(self.pool(top).flatten(1))
        for lateral, merge, skip in zip(self.lateral, self.merge, reversed(levels[1:-1]), strict=True):
            up = F.interpolate(lateral(top), size=skip.shape[-2:], mode="nearest")
            top = merge(up + skip)
        return self.maps(top), vector


class LocalSuccess(nn.Module):
    """Logits of p(S = 1 | i, h) and, where it was trained for that, of p(held | i, h), from local evidence."""

    def __init__(self, config: LocalConfig) -> None:
        super().__init__()
        self.config = config
        self.features = HandFeatures(config.hand)
        self.points = HandPoints(config.evidence)
        self.encoder = LocalEncoder(config)
        self.from_image = nn.Linear(config.vector, config.widths[0], bias=False)
        count = len(config.evidence.points)
        looked_up = count * (len(config.evidence.scales) + config.surfaces)
        looked_up += len(range(0, count, config.every)) * config.features
        self.head = mlp((config.hand.width + looked_up, *config.widths, 1))
        self.held = nn.Linear(config.widths[-1], 1) if config.held else None

    def weights_from(self, start: "LocalSuccess") -> dict[str, Tensor]:
        """The weights of a trained network for this one, which says the same with them.

        This one may look at more points, after those of the other; it begins without regard for them. An output for
        holding that the other does not have begins as that for success.
        """
        weights = dict(start.state_dict())
        first = torch.zeros_like(self.state_dict()["head.0.weight"])
        mine, theirs = self._columns(), start._columns()
        if len(first) == len(weights["head.0.weight"]) and theirs.keys() <= mine.keys():
            first[:, [mine[name] for name in theirs]] = weights["head.0.weight"]
            weights["head.0.weight"] = first
        if self.held is not None and "held.weight" not in weights:
            weights |= {f"held.{name}": value for name, value in start.head[-1].state_dict().items()}
        return weights

    def _columns(self) -> dict[tuple[object, ...], int]:
        """Where the head's first layer reads what: the hand, and of each point its signed depths and features."""
        config, points = self.config, self.config.evidence.points
        depths = [*(("scale", s) for s in config.evidence.scales), *(("surface", k) for k in range(config.surfaces))]
        names: list[tuple[object, ...]] = [("hand", k) for k in range(config.hand.width)]
        names += [(*kind, *p) for kind in depths for p in points]
        names += [("feature", k, *p) for k in range(config.features) for p in points[:: config.every]]
        return {name: column for column, name in enumerate(names)}

    def encode(self, images: Float[Tensor, "b 1 height width"]) -> Context:
        """Everything that depends on the image alone."""
        depth = self.points.view.fill(images)
        maps, vector = self.encoder(images, depth)
        return Context(depth, maps, self.from_image(vector))

    def forward(self, context: Context, hands: Hands) -> Float[Tensor, "b k"]:
        """Logit of p(S=1 | i, h) for each image with each of its hands."""
        if self._can_fuse(context, hands):
            return self._fused(context).values(hands[0]).squeeze(-1)[None]
        value: Tensor = self.head[-1](self.hidden(context, hands))
        return value.squeeze(-1)

    def both(self, context: Context, hands: Hands) -> tuple[Float[Tensor, "b k"], Float[Tensor, "b k"]]:
        """Logits of p(S=1 | i, h) and of p(held | i, h).

        Raises:
            CheckpointError: The network has no second output.
        """
        if self.held is None:
            raise CheckpointError("this model was not trained to say whether a grasp holds against pushes")
        hidden = self.hidden(context, hands)
        success, held = self.head[-1](hidden), self.held(hidden)
        return success.squeeze(-1), held.squeeze(-1)

    def hidden(self, context: Context, hands: Hands) -> Float[Tensor, "b k width"]:
        """The last hidden layer, which both outputs share."""
        first, *rest = list(self.head)[:-1]
        inputs = torch.cat([self.features(hands), self.look_up(context, hands)], -1)
        hidden: Tensor = first(inputs) + context.vector[:, None]
        for layer in rest:
            hidden = layer(hidden)
        return hidden

    def look_up(self, context: Context, hands: Hands) -> Float[Tensor, "b k n"]:
        """Local evidence of each hand."""
        grid, depth = self.points(hands)
        signed = depth - sample(context.depth, grid).squeeze(1)
        maps = sample(context.maps, self.in_window(grid))
        offsets, features = maps.split([self.config.surfaces, self.config.features], 1)
        behind = torch.tanh((signed[:, None] - OFFSET_UNIT * offsets) / OFFSET_SCALE)
        parts = [torch.tanh(signed / scale) for scale in self.config.evidence.scales]
        parts += [_by_hand(behind), _by_hand(features[..., :: self.config.every])]
        return torch.cat(parts, -1)

    def _can_fuse(self, context: Context, hands: Hands) -> bool:
        """Whether the compiled head can be asked: one image on the CPU, and no gradient wanted but in the hands."""
        first: nn.Linear = self.head[0]  # type: ignore[assignment]
        fixed = not any(tensor.requires_grad for tensor in (*context, first.weight))
        plain = {tensor.dtype for tensor in (*context, first.weight, hands.position)} == {torch.float32}
        near = len(hands.position) == 1 and hands.position.device.type == context.depth.device.type == "cpu"
        return fixed and plain and near and not torch.is_autocast_enabled("cpu")

    def _fused(self, context: Context) -> LocalHead:
        """The head for one image, compiled."""
        view, config = self.points.view, self.config
        top, left, height, width = config.seen
        maps = context.maps[0].permute(1, 2, 0)
        offsets, features = (part.contiguous().numpy() for part in maps.split([config.surfaces, config.features], -1))
        across, down = maps.shape[1] / width, maps.shape[0] / height
        window = np.array([across, across * (0.5 - left) - 0.5, down, down * (0.5 - top) - 0.5], np.float32)
        pinhole = (np.array(part, np.float32) for part in (view.config.focal, view.config.center))
        points = self.points.points.t().contiguous().numpy()
        eye = Eye(points, view.rotation.numpy(), view.translation.numpy(), *pinhole)
        seen = context.depth[0, 0].contiguous().numpy(), offsets, features, window
        scales = np.array(config.evidence.scales, np.float32)
        evidence = Evidence(*seen, scales, OFFSET_UNIT, OFFSET_SCALE, config.every)
        return LocalHead(self.features, eye, evidence, self.head, context.vector[0])

    def in_window(self, grid: Float[Tensor, "b k p 2"]) -> Float[Tensor, "b k p 2"]:
        """From sampling coordinates of the image to those of the window."""
        top, left, height, width = self.config.seen
        view = self.config.evidence.view
        scale = grid.new_tensor([view.width / width, view.height / height])
        return (grid + 1) * scale - grid.new_tensor([2 * left / width, 2 * top / height]) - 1


def _by_hand(values: Float[Tensor, "b c k p"]) -> Float[Tensor, "b k c*p"]:
    return values.transpose(1, 2).flatten(2)
