"""What is trained: the estimators of each preset with their objectives and schedules.

    paper   d_phi and d_theta as the paper describes them; every width and schedule that it leaves open is here
    best    p(S=1 | i, h) and p(held | i, h) by one network from local evidence, and r(S | h) by way of p(S=1 | h); they
            may learn from practice

Both may be followed by the full-observation estimator (the ideal rows of the paper's table); the joint ratio is the
ablation that the paper argues against.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.ratio.estimators import FullConfig, ImageConfig, SuccessRatioConfig
from bayesgrasp.ratio.evidence import PointsConfig, ViewConfig, between_fingertips, canonical_view, closing_region
from bayesgrasp.ratio.hand_success import HandSuccessConfig
from bayesgrasp.ratio.layers import ConvConfig, HandConfig
from bayesgrasp.ratio.local import WORKSPACE_WINDOW, LocalConfig, Window
from bayesgrasp.ratio.model import Role
from bayesgrasp.training.losses import LossConfig
from bayesgrasp.training.objectives import (
    FullObjective,
    HandSuccessObjective,
    ImageObjective,
    JointObjective,
    Objective,
    SuccessObjective,
    SuccessRatioObjective,
)
from bayesgrasp.training.train_estimator import TrainConfig

PresetName = Literal["paper", "best"]

DEFAULT_ROLES: dict[str, tuple[Role, ...]] = {"paper": ("success_ratio", "image"), "best": ("success_ratio", "success")}


@dataclass(frozen=True)
class Setup:
    """What the estimators must fit: the prior's support, the image, the set of meshes.

    Attributes:
        low, high: Support of the prior's positions, metres.
        view: The canonical camera at the network's image size.
        objects: Number of meshes.
        window: Where the view shows the workspace; see `LocalConfig`.
        success_rate: p(S=1) under the prior.
    """

    low: tuple[float, float, float] = HandConfig.low
    high: tuple[float, float, float] = HandConfig.high
    view: ViewConfig = field(default_factory=canonical_view)
    objects: int = 24
    window: Window | None = WORKSPACE_WINDOW
    success_rate: float = 0.01

    def hand(self, embedding: int) -> HandConfig:
        """The hand as a vector, with an embedding of the type of this length."""
        return HandConfig(self.low, self.high, embedding)


@dataclass(frozen=True)
class Part:
    """One estimator of a preset.

    Attributes:
        role: What it is for (`model.ROLES`).
        kind: Its architecture (`kinds.KINDS`).
        config: Of the architecture.
        objective: Its loss.
        train: Its schedule.
    """

    role: Role
    kind: str
    config: object
    objective: Objective
    train: TrainConfig


def preset(
    name: PresetName,
    setup: Setup,
    roles: Sequence[Role] | None = None,
    criterion: LossConfig | None = None,
    train: TrainConfig | None = None,
) -> tuple[Part, ...]:
    """The parts of a preset.

    Args:
        name: ``paper`` or ``best``.
        setup: What the estimators must fit.
        roles: Which estimators; those of `DEFAULT_ROLES` if None.
        criterion: Of the likelihood-to-evidence ratios; NRE-A, the paper's, if None.
        train: Schedule of the estimators with images; the others take the same with twice the learning rate.

    Raises:
        InvalidConfigurationError: No such preset.
    """
    if name not in DEFAULT_ROLES:
        raise InvalidConfigurationError(f"there is no preset {name!r}; choose from {', '.join(DEFAULT_ROLES)}")
    criterion, train = criterion or LossConfig(), train or TrainConfig()
    # Without convolutions bfloat16 saves nothing, and rounds the place of a hand to a millimetre.
    fast = replace(train, learning_rate=2 * train.learning_rate, bf16=False)
    ratio = _ratio(name, setup, criterion, fast)
    image = ImageConfig(setup.hand(1), ConvConfig((setup.view.height, setup.view.width)), activation="relu")
    if name == "paper":
        success = Part("success", "global", image, SuccessObjective(), train)
    else:
        points = PointsConfig(setup.view, closing_region() + between_fingertips())
        local = LocalConfig(setup.hand(4), points, window=setup.window, held=True)
        success = Part("success", "local", local, SuccessObjective(), replace(train, mirror=0.5))
    full = FullConfig(setup.hand(4), setup.objects, octaves=2, modulated=True)
    parts = {
        "success_ratio": ratio,
        "image": Part("image", "image", image, ImageObjective(criterion), train),
        "joint": Part("joint", "joint", image, JointObjective(criterion), train),
        "success": success,
        "full": Part("full", "full", full, FullObjective(), fast),
    }
    return tuple(parts[role] for role in (DEFAULT_ROLES[name] if roles is None else roles))


def _ratio(name: PresetName, setup: Setup, criterion: LossConfig, train: TrainConfig) -> Part:
    """r(S | h): the paper's d_phi, or by way of p(S=1 | h)."""
    if name == "paper":
        # It sees few successes and could learn them by heart.
        held_back = replace(train, mirror=0.5, weight_decay=0.1)
        config = SuccessRatioConfig(setup.hand(1))
        return Part("success_ratio", "success_ratio", config, SuccessRatioObjective(criterion), held_back)
    known = HandSuccessConfig(setup.hand(4), success_rate=setup.success_rate)
    return Part("success_ratio", "hand_success", known, HandSuccessObjective(), replace(train, mirror=0.5, turn=True))
