"""Joins a trained model, the canonical view, the hand and the arm to a planner: `bayesgrasp.load`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from bayesgrasp.errors import CheckpointError, InvalidConfigurationError, clipped, shown
from bayesgrasp.geometry.camera import network_camera
from bayesgrasp.observation.canonical_view import CanonicalView
from bayesgrasp.observation.familiarity import Familiarity
from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.plain_data import restored
from bayesgrasp.planning.observing import Observer
from bayesgrasp.planning.planner import Planner, PlannerConfig, TrainedLikelihood
from bayesgrasp.planning.selection import Robot
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.ratio.checkpoint import load_model
from bayesgrasp.ratio.delivery import Delivery
from bayesgrasp.ratio.kinds import LIMITS
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.robot.arm import ur5
from bayesgrasp.robot.arm_over_table import ArmOverTable
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.types import Hands

SHIPPED = Path(__file__).parents[1] / "weights"
MODELS = ("general", "paper")
"""The trained models that come with the package, by name; the first is the default."""


def model_directory(model: Path | str | None = None) -> Path:
    """The directory of a model: of one that comes with the package by its name, the default one if None."""
    name = MODELS[0] if model is None else str(model)
    return SHIPPED / name if name in MODELS and not Path(name).is_dir() else Path(name)


DEFAULT_MODEL, PAPER_MODEL = model_directory(), model_directory("paper")


def load_planner(
    model: Path | str | None = None, device: str | torch.device = "cpu", config: PlannerConfig | None = None
) -> Planner:
    """A planner for the Robotiq 3-Finger on a UR5 from a trained model.

    Args:
        model: Directory of a model, or the name of one that comes with the package: general or paper; by default the
            first.
        device: Where the network is evaluated and searched: cpu, cuda, or cuda:N.
        config: Cost and behaviour of the plans.

    Raises:
        CheckpointError: The model is missing, damaged, or was trained for another gripper, camera or schema.
        InvalidConfigurationError: The device cannot be used.
    """
    where = usable_device(device)
    gripper, trained = robotiq_3f(), load_trained(model)
    _check_answers(trained)
    trained = trained.to(where)
    familiarity = trained.card.get("familiarity")
    known = None if familiarity is None else Familiarity.from_dict(familiarity)
    delivery = trained_delivery(trained.card)
    held = trained.held_given_image if trained.holds else None
    return Planner(
        TrainedLikelihood(trained.given_image, success_probability(trained, delivery), delivery, where, held),
        trained_prior(trained.card),
        Observer(CanonicalView().of, SurfaceReader(network_camera()), known),
        Robot(OpenHand(gripper), ArmOverTable(ur5(), gripper)),
        config or PlannerConfig(),
    )


def usable_device(name: str | torch.device) -> torch.device:
    """A device, if torch can compute on it.

    Raises:
        InvalidConfigurationError: It cannot.
    """
    try:
        torch.ones(1, device=name).tolist()
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        raise InvalidConfigurationError(
            f"the device {shown(str(name))} cannot be used; valid: cpu, and cuda or cuda:N where torch has it "
            f"({clipped(error)})"
        ) from error
    return torch.device(name)


def load_trained(model: Path | str | None = None) -> GraspModel:
    """A trained model for the Robotiq 3-Finger, without a planner around it; arguments and errors of `load_planner`."""
    return load_model(model_directory(model), hand=robotiq_3f().identity)


def _check_answers(model: GraspModel) -> None:
    """Refuse a model whose card and weights fit one another but not the images that a planner has.

    Raises:
        CheckpointError: It cannot be asked about an empty image, or its answer is no number.
    """
    camera = network_camera()
    hand = Hands(torch.tensor([[0.0, 0.0, 0.2]]), torch.eye(3)[None], torch.zeros(1, dtype=torch.int64))
    try:
        with torch.no_grad():
            answer = model.given_image(torch.zeros(1, camera.height, camera.width))(hand)
    except RuntimeError as error:  # shapes that do not fit
        raise CheckpointError(
            f"the model does not take images of {camera.width} x {camera.height} pixels: {clipped(error)}"
        ) from error
    if not bool(answer.isfinite().all()):
        raise CheckpointError("the model does not answer with numbers: its weights are those of no trained model")


def trained_prior(card: Mapping[str, Any]) -> GraspPrior:
    """The prior over hands that a model was trained with."""
    try:
        return restored(GraspPrior, card.get("prior", {}), LIMITS)
    except ValueError as error:
        raise CheckpointError(f"the prior in the model's card cannot be read: {error}") from error


def trained_delivery(card: Mapping[str, Any]) -> Delivery | None:
    """What plans of a model delivered on fresh objects; None where its card does not say."""
    return Delivery.from_dict(card["delivery"]) if "delivery" in card else None


def success_probability(model: GraspModel, delivery: Delivery | None = None) -> Callable[[Tensor], Tensor]:
    """From values of the model's log-ratio to estimates of p(S=1 | i, h).

    A success estimator's log-ratio is a log p(S=1 | i, h) with the model's power a. For a factorised one
    p(S=1 | i, h) = r p(S=1 | i), where p(S=1) of the training data stands for p(S=1 | i).

    Args:
        model: The model.
        delivery: Calibrates the estimates to fresh objects.
    """
    rate = float(model.card.get("success_rate") or math.nan)

    def estimate(log_ratio: Tensor) -> Tensor:
        if "success" in model.estimators:
            return (log_ratio / model.power).exp().clamp(max=1.0)
        return (log_ratio.exp() * rate).clamp(max=1.0)

    if delivery is None:
        return estimate
    calibration = delivery.calibration
    return lambda log_ratio: log_ratio.new_tensor(calibration.of(estimate(log_ratio).cpu().numpy()))
