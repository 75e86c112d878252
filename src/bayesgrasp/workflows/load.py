"""Joins a trained model, the canonical view, the hand and the arm to a planner: `bayesgrasp.load`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jaxtyping import Float32
    from numpy import ndarray
    from torch import Tensor

    from bayesgrasp.geometry.camera import Camera
    from bayesgrasp.planning.planner import Planner, PlannerConfig, View
    from bayesgrasp.prior.grasp import GraspPrior
    from bayesgrasp.ratio.model import GraspModel

DEFAULT_MODEL = Path(__file__).parents[1] / "weights"
"""The trained model that comes with the package."""


def load_planner(model: Path | str | None = None, config: PlannerConfig | None = None) -> Planner:
    """A planner for the Robotiq 3-Finger on a UR5 from a trained model.

    Args:
        model: Directory of a model; by default the one that comes with the package.
        config: Cost and behaviour of the plans.

    Raises:
        CheckpointError: The model is missing, damaged, or was trained for another gripper, camera or schema.
    """
    from bayesgrasp.geometry.camera import canonical_camera
    from bayesgrasp.observation.familiarity import Familiarity
    from bayesgrasp.observation.surface import SurfaceReader
    from bayesgrasp.planning.planner import Planner, PlannerConfig, Posterior
    from bayesgrasp.planning.selection import Robot
    from bayesgrasp.ratio.checkpoint import load_model
    from bayesgrasp.robot.arm import ur5
    from bayesgrasp.robot.arm_reach import ArmReach
    from bayesgrasp.robot.open_hand import OpenHand
    from bayesgrasp.robot.robotiq_3f import robotiq_3f

    gripper = robotiq_3f()
    trained = load_model(DEFAULT_MODEL if model is None else Path(model), gripper=gripper.name)
    familiarity = trained.card.get("familiarity")
    return Planner(
        Posterior(trained.given_image, success_probability(trained)),
        trained_prior(trained.card),
        canonical_view(),
        SurfaceReader(canonical_camera().resized(256, 160)),
        Robot(OpenHand(gripper), ArmReach(ur5(), gripper)),
        None if familiarity is None else Familiarity.from_dict(familiarity),
        config or PlannerConfig(),
    )


def trained_prior(card: Mapping[str, Any]) -> GraspPrior:
    """The prior over hands that a model was trained with."""
    from bayesgrasp.errors import CheckpointError
    from bayesgrasp.prior.grasp import GraspPrior

    content: dict[str, Any] = {
        name: tuple(v) if isinstance(v, list) else v for name, v in card.get("prior", {}).items()
    }
    try:
        return GraspPrior(**content)
    except TypeError as error:
        raise CheckpointError(f"the prior in the model's card cannot be read: {error}") from error


def success_probability(model: GraspModel) -> Callable[[Tensor], Tensor]:
    """From values of the model's log-ratio to estimates of p(S=1 | i, h).

    A success estimator's log-ratio is a log p(S=1 | i, h) with the model's power a. For a factorised one
    p(S=1 | i, h) = r p(S=1 | i), where p(S=1) of the training data stands for p(S=1 | i).
    """
    import math

    if "success" in model.estimators:
        return lambda log_ratio: (log_ratio / model.power).exp().clamp(max=1.0)
    rate = float(model.card.get("success_rate") or math.nan)
    return lambda log_ratio: (log_ratio.exp() * rate).clamp(max=1.0)


def canonical_view() -> View:
    """Any camera's depth image as the network's image."""
    import numpy as np

    from bayesgrasp.geometry.camera import canonical_camera
    from bayesgrasp.observation.canonical_view import to_canonical_view
    from bayesgrasp.observation.preprocess import FAR, NEAR, preprocess

    known = canonical_camera()
    target = known.resized(256, 160)

    def view(depth: Float32[ndarray, "h w"], camera: Camera) -> Float32[ndarray, "height width"]:
        if _same(camera, known):
            return preprocess(depth)
        # The network's image is coarser than most cameras': pixels that it cannot show are not drawn.
        step = max(1, int(camera.fx / target.fx))
        image = to_canonical_view(*_thinned(depth, camera, step), target, complete_table=True)
        return np.where((image >= np.float32(NEAR)) & (image <= np.float32(FAR)), image, np.float32(0.0))

    return view


def _same(left: Camera, right: Camera) -> bool:
    import numpy as np

    same_size = (left.width, left.height) == (right.width, right.height)
    return (
        same_size
        and np.allclose(left.matrix, right.matrix, rtol=1e-6)
        and np.allclose(left.pose, right.pose, atol=1e-6)
    )


def _thinned(
    depth: Float32[ndarray, "h w"], camera: Camera, step: int
) -> tuple[Float32[ndarray, "rows columns"], Camera]:
    """Every `step`-th pixel, each way, and the camera that sees just these."""
    from dataclasses import replace

    first = step // 2
    small = depth[first::step, first::step]
    changes = {name: getattr(camera, name) / step for name in ("fx", "fy")}
    changes |= {name: (getattr(camera, name) - first) / step for name in ("cx", "cy")}
    return small, replace(camera, width=small.shape[1], height=small.shape[0], **changes)
