"""What a data set says to those who train on it: what each estimator learns from, what it must fit, what its card says.

Which practice teaches what follows from what its hands knew (`generation.practice`): hands that knew the image alone
teach p(S = 1 | i, h), all hands teach the estimator that is told the mesh, and none teach ratios of densities.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from bayesgrasp.data.attempts import refreshed_attempts
from bayesgrasp.data.images import to_metres
from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.errors import DataError, InvalidConfigurationError
from bayesgrasp.generation.provenance import source_commit
from bayesgrasp.geometry.camera import network_camera
from bayesgrasp.observation.familiarity import fit_familiarity
from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.prior.planar_symmetry import PlanarRefresh
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.ratio.checkpoint import Origin
from bayesgrasp.ratio.model import Role
from bayesgrasp.robot.arm import ur5
from bayesgrasp.robot.motion import MotionConfig, reached
from bayesgrasp.training.presets import Setup
from bayesgrasp.training.sources import Sources, scene_sources, with_practice
from bayesgrasp.types import Outcome
from bayesgrasp.workflows.load import trained_prior

FAMILIARITY_IMAGES = 1000


def sources_by_role(
    roles: Iterable[Role], dataset: GraspDataset, practice: Sequence[GraspDataset], batch_size: int, seed: int
) -> dict[Role, Sources]:
    """What each estimator learns from, and what it is validated on.

    r(S | h) learns from attempts; p(S = 1 | i, h) from scenes and from practice whose hands knew the image alone; the
    estimator that is told the mesh from scenes and from all practice on meshes of the data set; the others from scenes.

    Args:
        roles: The estimators.
        dataset: Draws from the prior, or weighted to it.
        practice: Data sets of practice.
        batch_size: Scenes in a batch.
        seed: Of the orders and of the refreshed poses.

    Raises:
        DataError: The data set is too small, or an estimator cannot learn from a set of practice.
    """
    return {role: _sources(role, dataset, practice, batch_size, seed) for role in roles}


def _sources(
    role: Role, dataset: GraspDataset, practice: Sequence[GraspDataset], batch_size: int, seed: int
) -> Sources:
    if role == "success_ratio":
        return Sources(*refreshed_attempts(dataset, planar_refresh(dataset), seed=seed))
    scenes = scene_sources(dataset, batch_size, seed)
    if role == "full":
        return with_practice(scenes, practice, batch_size, seed, dataset.object_ids)
    if role == "success":
        seen = [one for one in practice if one.manifest.given == "image"]
        return with_practice(scenes, seen, batch_size, seed)
    return scenes


def planar_refresh(dataset: GraspDataset) -> PlanarRefresh:
    """The planar symmetry of the priors and of the arm that a data set was made with."""
    config = dataset.manifest.config
    scene: dict[str, Any] = {
        name: tuple(v) if isinstance(v, list) else v for name, v in config.get("scene", {}).items()
    }
    try:
        motion = MotionConfig(**config.get("lift_test", {}).get("motion", {}))
        return PlanarRefresh(
            trained_prior({"prior": prior_of(dataset)}), ScenePrior(**scene), partial(reached, ur5(), motion)
        )
    except TypeError as error:
        raise DataError(f"the manifest of the data set does not state its scenes as they are now: {error}") from error


def setup_of(dataset: GraspDataset) -> Setup:
    """What the estimators must fit, by the manifest of the data."""
    prior = prior_of(dataset)
    low, high = (tuple(float(prior[axis][end]) for axis in ("x", "y", "z")) for end in (0, 1))
    return Setup(low=low, high=high, objects=len(dataset.object_ids))  # type: ignore[arg-type]


def prior_of(dataset: GraspDataset) -> dict[str, Any]:
    """The prior of the hands, as the manifest states it.

    Raises:
        DataError: It does not.
    """
    prior = dataset.manifest.config.get("generate", {}).get("grasp", {})
    if not {"x", "y", "z"} <= prior.keys():
        raise DataError("the manifest of the data set does not state the prior of the hands")
    return dict(prior)


def origin_of(dataset: GraspDataset) -> Origin:
    """Where a model of this data comes from, for its card."""
    content = json.dumps([dataset.manifest.identity, dataset.manifest.totals], sort_keys=True)
    return Origin(
        gripper=dataset.manifest.gripper,
        prior=prior_of(dataset),
        data=hashlib.sha256(content.encode()).hexdigest()[:16],
        commit=source_commit() or None,
        success_rate=_success_rate(dataset),
        objects=dataset.object_ids,
    )


def _success_rate(dataset: GraspDataset) -> float:
    """p(S=1) under the prior: the weighted share of successful attempts."""
    columns = dataset.attempt_columns
    weight = np.exp(columns["log_weight"].astype(np.float64) + columns["object_log_weight"])
    return float((weight * (columns["outcome"] == Outcome.SUCCESS)).sum() / weight.sum())


def familiarity_of(dataset: GraspDataset) -> dict[str, Any] | None:
    """Statistics of simulated images, by which the planner knows unfamiliar ones; None for a tiny data set."""
    rows = dataset.scenes("train").rows
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), FAMILIARITY_IMAGES)).astype(int)]
    reader = SurfaceReader(network_camera())
    images = (to_metres(dataset.scene_columns["image"][row]) for row in rows)
    surfaces = [surface for image in images if (surface := reader.read(image)).item.any()]
    try:
        return fit_familiarity(surfaces).to_dict()
    except InvalidConfigurationError:
        return None
