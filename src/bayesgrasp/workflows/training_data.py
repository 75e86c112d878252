"""What a data set says to those who train on it: what each estimator learns from, what it must fit, what its card says.

Which practice teaches what follows from what its hands knew (`generation.practice`): hands that knew nothing teach
p(S = 1 | h), hands that knew the image alone teach p(S = 1 | i, h), the latter and those that knew the object teach the
estimator that is told the mesh, and none teach ratios of densities.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from bayesgrasp.data.attempts import AttemptsConfig, refreshed_attempts
from bayesgrasp.data.images import to_metres
from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.data.manifest import Given
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
from bayesgrasp.training.objectives import HandSuccessObjective
from bayesgrasp.training.presets import Part, Setup
from bayesgrasp.training.sources import Sources, scene_sources, with_blind_practice, with_practice
from bayesgrasp.types import HandIdentity, Outcome
from bayesgrasp.workflows.load import trained_prior

FAMILIARITY_IMAGES = 1000


def sources_by_role(
    parts: Sequence[Part], dataset: GraspDataset, practice: Sequence[GraspDataset], batch_size: int, seed: int
) -> dict[Role, Sources]:
    """What each estimator learns from, and what it is validated on.

    r(S | h) learns from attempts, by way of p(S = 1 | h) also from practice whose hands knew nothing; p(S = 1 | i, h)
    from scenes and from practice whose hands knew the image alone; the estimator that is told the mesh from scenes and
    from all practice with images on meshes of the data set; the others from scenes.

    Args:
        parts: The estimators.
        dataset: Draws from the prior, or weighted to it.
        practice: Data sets of practice.
        batch_size: Scenes in a batch.
        seed: Of the orders and of the refreshed poses.

    Raises:
        DataError: The data set is too small, or an estimator cannot learn from a set of practice.
    """
    identity = " ".join(one.fingerprint for one in (dataset, *practice))
    return {
        part.role: replace(_sources(part, dataset, practice, batch_size, seed), identity=identity) for part in parts
    }


def _sources(
    part: Part, dataset: GraspDataset, practice: Sequence[GraspDataset], batch_size: int, seed: int
) -> Sources:
    if part.role == "success_ratio":
        learns = isinstance(part.objective, HandSuccessObjective)
        config = AttemptsConfig(batch_size=512 if learns else 2048)
        attempts = Sources(*refreshed_attempts(dataset, planar_refresh(dataset), config, seed))
        return with_blind_practice(attempts, _of(practice, "nothing") if learns else (), seed)
    scenes = scene_sources(dataset, batch_size, seed)
    if part.role == "full":
        return with_practice(scenes, _of(practice, "image", "object"), batch_size, seed, dataset.object_ids)
    if part.role == "success":
        return with_practice(scenes, _of(practice, "image"), batch_size, seed)
    return scenes


def _of(practice: Sequence[GraspDataset], *given: Given) -> list[GraspDataset]:
    """The sets of practice whose hands knew one of these."""
    return [one for one in practice if one.manifest.given in given]


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


def check_hands(datasets: Iterable[GraspDataset], hand: HandIdentity) -> None:
    """Refuse data sets of another hand.

    Raises:
        DataError: There is one.
    """
    for dataset in datasets:
        if another := dataset.manifest.hand.compare(hand):
            raise DataError(f"the data set {dataset.store.directory} is for {another}")


def setup_of(dataset: GraspDataset) -> Setup:
    """What the estimators must fit, by the manifest of the data."""
    prior = prior_of(dataset)
    low, high = (tuple(float(prior[axis][end]) for axis in ("x", "y", "z")) for end in (0, 1))
    # A set without a success teaches no r(S | h), and says so when it is asked to; the others need no rate.
    objects, rate = len(dataset.object_ids), max(_success_rate(dataset), 1e-6)
    return Setup(low=low, high=high, objects=objects, success_rate=rate)  # type: ignore[arg-type]


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
        gripper_sha256=dataset.manifest.gripper_sha256,
        prior=prior_of(dataset),
        data=hashlib.sha256(content.encode()).hexdigest()[:16],
        commit=source_commit() or None,
        success_rate=_success_rate(dataset),
        objects=dataset.object_ids,
        cameras=dataset.manifest.cameras,
    )


def _success_rate(dataset: GraspDataset) -> float:
    """p(S=1) under the prior: the weighted share of successful attempts."""
    columns = dataset.attempt_columns
    weight = np.exp(columns["log_weight"].astype(np.float64) + columns["object_log_weight"])
    return float((weight * (columns["outcome"] == Outcome.SUCCESS)).sum() / weight.sum())


def familiarity_of(dataset: GraspDataset) -> dict[str, Any] | None:
    """Statistics of simulated images, by which the planner knows unfamiliar ones; None for a set with few or none."""
    if dataset.images == 0:
        return None
    rows = dataset.scenes("train").rows
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), FAMILIARITY_IMAGES)).astype(int)]
    reader = SurfaceReader(network_camera())
    images = (to_metres(dataset.scene_columns["image"][row]) for row in rows)
    surfaces = [surface for image in images if (surface := reader.read(image)).item.any()]
    try:
        return fit_familiarity(surfaces).to_dict()
    except InvalidConfigurationError:
        return None
