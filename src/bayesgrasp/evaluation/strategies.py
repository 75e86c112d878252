"""The strategies of the paper's table (section 4.2), as potentials for one and the same search.

    prior_sample       h ~ p(h)
    prior_argmax       argmax p(h)
    mle_success_ratio  argmax p(S=1 | h)                    map_success_ratio  argmax p(h | S=1)
    mle_image          argmax p(S=1, i | h)                 map_image          argmax p(h | S=1, i)
    mle_full           argmax p(S=1, O, p_O, beta, mu | h)  map_full           argmax p(h | S=1, O, p_O, beta, mu)

A likelihood is maximised inside the prior's box of positions, where alone its estimator is defined; the prior's density
of rotations and types is what it leaves out. The image rows use the model's image posterior, whichever it holds
(`ratio.model`). The full rows know the object's mesh, scale, pose and true friction, so they are defined only on
objects that the model was trained with. All searches of a scene start from the same draws.

Two baselines that a user would try first stand beside them (`top_down`, `force_closure`), and `plan` is what the
deployed planner would do: the best grasp of its ranking that the arm can reach without hitting what the camera sees.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch

from bayesgrasp.errors import DepthImageError, InvalidConfigurationError
from bayesgrasp.evaluation.scenes import Situation
from bayesgrasp.evaluation.shifts import Shift
from bayesgrasp.planning.plan import Plan
from bayesgrasp.planning.planner import Planner
from bayesgrasp.posterior.ascent import AscentConfig, find_map
from bayesgrasp.posterior.potential import (
    LogDensity,
    Potential,
    Prior,
    likelihood_potential,
    posterior_potential,
    prior_potential,
)
from bayesgrasp.ratio.model import GraspModel, route_given_image
from bayesgrasp.types import Hands

PRIOR = ("prior_sample", "prior_argmax")
SUCCESS_RATIO = ("mle_success_ratio", "map_success_ratio")
IMAGE = ("mle_image", "map_image")
FULL = ("mle_full", "map_full")
LADDER = (*PRIOR, *SUCCESS_RATIO, *IMAGE, *FULL)
BASELINES = ("top_down", "force_closure")
STRATEGIES = (*LADDER, *BASELINES, "plan")
SEES_IMAGE = (*IMAGE, "top_down", "plan")
KNOWS_OBJECT = (*FULL, "force_closure")
"""Mesh, pose, size and friction."""

Choose = Callable[[Situation, np.random.Generator], Hands | None]
"""From a scene to one hand, of batch shape (1,); None where a strategy declines."""


@dataclass(frozen=True)
class Choice:
    """What a strategy chose.

    Attributes:
        hands: One hand, of batch shape (1,).
        promised: Its own p(S=1 | i, h); None where it does not say.
    """

    hands: Hands
    promised: float | None = None


Strategy = Callable[[Situation, np.random.Generator], Choice | None]
"""From a scene to a choice; None where a strategy declines."""


@dataclass(frozen=True)
class SearchConfig:
    """The search of every optimising strategy; the defaults are those of the paper's Algorithm 2.

    Attributes:
        num_draws: Draws from the prior that compete for the starts.
        ascent: The ascents.

    Raises:
        InvalidConfigurationError: No draws.
    """

    num_draws: int = 1000
    ascent: AscentConfig = field(default_factory=AscentConfig)

    def __post_init__(self) -> None:
        if self.num_draws < 1:
            raise InvalidConfigurationError(f"num_draws must be at least 1, got {self.num_draws}")


def missing(name: str, roles: Sequence[str]) -> str | None:
    """What a model with these estimators lacks for a strategy, in words; None where nothing."""
    if name in SUCCESS_RATIO and "success_ratio" not in roles:
        return "the model has no success_ratio estimator, r(S=1 | h)"
    if (name in IMAGE or name == "plan") and route_given_image(roles) is None:
        return "the model has no estimator of p(S=1, i | h)"
    if name in FULL and "full" not in roles:
        return "the model has no full-observation estimator"
    return None


def replans(name: str, shift: Shift) -> bool:
    """Whether a shift changes what a strategy looks at, so that it chooses again."""
    return (name in SEES_IMAGE and shift.changes_image) or (name in KNOWS_OBJECT and shift.changes_object)


def model_strategies(model: GraspModel, prior: Prior, search: SearchConfig) -> dict[str, Choose]:
    """The eight rows of the table by name; each needs the estimators that `missing` looks for."""
    meshes = {name: index for index, name in enumerate(model.card.get("objects", ()))}
    ratios: dict[str, Callable[[Situation], LogDensity]] = {
        "success_ratio": lambda situation: model.given_success(),
        "image": lambda situation: model.given_image(torch.from_numpy(situation.image)[None]),
        "full": lambda situation: _given_object(model, meshes, situation),
    }
    chosen: dict[str, Choose] = {
        "prior_sample": lambda situation, rng: prior.sample(1, rng),
        "prior_argmax": lambda situation, rng: _minimum(prior_potential(prior), prior, search, rng),
    }
    for kind, ratio in ratios.items():
        chosen[f"mle_{kind}"] = _optimum(likelihood_potential, ratio, prior, search)
        chosen[f"map_{kind}"] = _optimum(posterior_potential, ratio, prior, search)
    return chosen | {name: from_the_image(chosen[name]) for name in IMAGE}


def from_the_image(choose: Choose) -> Choose:
    """A strategy that chooses in the frame of the network's image, with its hand brought into the world frame."""

    def turned(situation: Situation, rng: np.random.Generator) -> Hands | None:
        hands = choose(situation, rng)
        return None if hands is None else situation.in_world(hands)

    return turned


def planned(planner: Planner) -> Strategy:
    """The deployed planner's first grasp, with its promise; None where it declines to grasp or refuses the image."""

    def choose(situation: Situation, rng: np.random.Generator) -> Choice | None:
        try:
            plan = planner.plan(situation.depth, situation.camera, top=1, seed=rng)
        except DepthImageError:  # as of a camera too low to see anything but the object
            return None
        hands = first_grasp(plan)
        if hands is None:
            return None
        promised = plan.grasps[0].success_probability
        return Choice(hands, promised if math.isfinite(promised) else None)

    return choose


def unpromised(choose: Choose) -> Strategy:
    """A strategy that does not say how likely its hand is to succeed."""

    def strategy(situation: Situation, rng: np.random.Generator) -> Choice | None:
        hands = choose(situation, rng)
        return None if hands is None else Choice(hands)

    return strategy


def first_grasp(plan: Plan) -> Hands | None:
    """The hand of a plan's best grasp, batch shape (1,); None where there is no grasp."""
    if not plan.grasps:
        return None
    pose = torch.from_numpy(plan.grasps[0].hand_to_world).float()
    types = torch.tensor([int(plan.grasps[0].grasp_type)])
    return Hands(pose[None, :3, 3], pose[None, :3, :3], types)


def _optimum(
    potential: Callable[[LogDensity, Prior], Potential],
    ratio: Callable[[Situation], LogDensity],
    prior: Prior,
    search: SearchConfig,
) -> Choose:
    def choose(situation: Situation, rng: np.random.Generator) -> Hands | None:
        return _minimum(potential(ratio(situation), prior), prior, search, rng)

    return choose


def _minimum(potential: Potential, prior: Prior, search: SearchConfig, rng: np.random.Generator) -> Hands:
    best = find_map(potential, prior, rng, search.num_draws, search.ascent).best
    return Hands(best.position[None], best.rotation[None], best.grasp_type[None])


def _given_object(model: GraspModel, meshes: Mapping[str, int], situation: Situation) -> LogDensity:
    if situation.asset.id not in meshes:
        raise InvalidConfigurationError(f"the model was not trained with the object '{situation.asset.id}'")
    scale, friction = float(situation.scene.scale[0]), float(situation.nuisances.lateral_friction[0])
    return model.given_object(meshes[situation.asset.id], scale, situation.pose, friction)
