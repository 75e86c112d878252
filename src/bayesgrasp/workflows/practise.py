"""Data sets of a model's own proposals: ``bayesgrasp practice``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch

from bayesgrasp.data.manifest import Given, Manifest
from bayesgrasp.errors import CheckpointError, InvalidConfigurationError
from bayesgrasp.generation.blind_practice import BlindProposer, BlindRecipe
from bayesgrasp.generation.chunks import GenerateConfig, SimulatedWorld
from bayesgrasp.generation.exploration import Explorer
from bayesgrasp.generation.pairing import PairingConfig
from bayesgrasp.generation.pool import LocalPool
from bayesgrasp.generation.practice import PracticeRecipe, Proposer, Shown
from bayesgrasp.generation.provenance import describe
from bayesgrasp.generation.run import Progress, Recipe, Run, open_store
from bayesgrasp.geometry.camera import network_camera
from bayesgrasp.objects.deform import DeformConfig, with_copies
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.posterior.potential import LogDensity
from bayesgrasp.posterior.practice_hands import blind_hands, practice_hands
from bayesgrasp.prior.cameras import CameraLaw, camera_law
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.ratio.card import read_card, trained_hand
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Hands
from bayesgrasp.workflows.load import load_trained, trained_prior

Practised = Literal["success", "full", "success_ratio"]
GIVEN: dict[Practised, Given] = {"success": "image", "full": "object", "success_ratio": "nothing"}
"""What each estimator is told of a scene."""
BLIND_CHUNK = 512
"""Attempts of a chunk without images."""


@dataclass(frozen=True)
class PracticeJob:
    """What is practised.

    Attributes:
        model: Directory of the model that proposes.
        objects: The object set; never the unseen ones if they are to stay unseen.
        scenes: How many images; for success_ratio, which looks at none, how many scenes of one try each.
        tries: Hands tried for each image, at least 3.
        estimator: Which one proposes: success (it sees the image), full (it knows object, pose and friction) or
            success_ratio (it knows nothing).
        deform: Copies of each object that are practised on beside it, for more shapes than there are scans; then
            p(O) is uniform over objects and copies.
        cameras: Where images are taken from; as in the data that the model was trained on if None.
        seed: Of all random numbers.
        explore: How many of the tries are hands from above that no model proposes (`generation.exploration`).

    Raises:
        InvalidConfigurationError: Too few scenes or tries, or exploration without images.
    """

    model: Path
    objects: tuple[ObjectAsset, ...]
    scenes: int = 2000
    tries: int = 12
    estimator: Practised = "success"
    deform: DeformConfig = field(default_factory=DeformConfig)
    cameras: CameraLaw | None = None
    seed: int = 0
    explore: int = 0

    def __post_init__(self) -> None:
        if self.scenes < 1 or self.tries < 3:
            raise InvalidConfigurationError(
                f"practice needs at least 1 scene and 3 tries, got {self.scenes} and {self.tries}"
            )
        if not 0 <= self.explore <= self.tries - 3 * (self.explore < self.tries):
            raise InvalidConfigurationError(
                f"exploration takes all tries or leaves at least 3, got {self.explore} of {self.tries}"
            )
        if self.explore and self.given != "image":
            raise InvalidConfigurationError(f"{self.estimator} looks at no image; exploration needs one")

    @property
    def attempts(self) -> int:
        """Lift tests in all."""
        return self.scenes * self.tries_each

    @property
    def given(self) -> Given:
        """What the hands know of their scene."""
        return GIVEN[self.estimator]

    @property
    def tries_each(self) -> int:
        """Hands tried in a scene; without an image every hand has a scene of its own."""
        return 1 if self.given == "nothing" else self.tries

    def sizes(self, card: Mapping[str, Any]) -> GenerateConfig:
        """What a chunk holds, given the card of the model."""
        images = int(self.given != "nothing")
        return GenerateConfig(
            proposal="prior",
            attempts_per_draw=self.tries_each,
            scenes_per_draw=images,
            draws_per_chunk=32 if images else BLIND_CHUNK,
            pairing=PairingConfig(hands=self.tries),
            grasp=trained_prior(card),
            camera=camera_law(self.cameras or card.get("cameras", "canonical")),
        )


def practise(
    job: PracticeJob,
    out: Path | str,
    workers: int = 1,
    *,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Manifest:
    """Try the hands that a model proposes for new scenes, and keep the outcomes as training data.

    Args:
        job: What is practised.
        out: Directory of the new data set.
        workers: Processes; the records do not depend on their number.
        resume: Go on with the data set in ``out``, or start it where there is none.
        progress: Told after every chunk.

    Returns:
        The manifest with the final counts.

    Raises:
        CheckpointError: There is no such model, or it is for another hand.
        DataError: There is a data set in ``out`` already, of another kind or being written, or it is damaged.
        InvalidConfigurationError: An estimator that is told the mesh never knew these objects.
    """
    objects = with_copies(job.objects, job.deform, generator(job.seed, Stream.COPIES))
    world, scene = SimulatedWorld(objects), ScenePrior(len(objects))
    card = read_card(job.model)
    if another := trained_hand(card).compare(world.gripper.identity):
        raise CheckpointError(f"the model {job.model} is for {another}")
    config = job.sizes(card)
    manifest = describe(world, config, job.seed, scene, job.attempts)
    if job.explore:
        manifest = replace(
            manifest, config=manifest.config | {"practice": {"given": job.given, "explore": job.explore}}
        )
    if job.given == "object":
        _check_objects(job.model, tuple(asset.id for asset in objects))
    if job.given != "image":
        manifest = replace(manifest, config=manifest.config | {"practice": {"given": job.given}})
    proposer = ModelProposer(job.model.resolve(), job.given, job.explore)
    recipe: Recipe = PracticeRecipe(world.build, config, job.seed, scene, proposer.build, job.given)
    if job.given == "nothing":
        recipe = BlindRecipe(world.build, config, job.seed, scene, proposer.build_blind)
    store = open_store(Path(out), manifest, resume)
    return Run(store, recipe, job.attempts, progress).execute(LocalPool(workers))


def _check_objects(model: Path, ids: tuple[str, ...]) -> None:
    """An estimator that is told the mesh by its number must have been trained on the same objects."""
    known = tuple(read_card(model).get("objects", ()))
    if known != ids:
        raise InvalidConfigurationError(
            f"the full-observation estimator of {model} knows the objects {', '.join(known) or 'of no list'}; practise "
            "on the split that it was trained on, with --copies 0"
        )


@dataclass(frozen=True)
class ModelProposer:
    """q(h | i), q(h | O, p_O, beta, mu), or q(h), of a model that is loaded in the worker that uses it.

    Attributes:
        directory: Of the model.
        given: What the model is told of a scene.
        explore: How many hands of a scene are explored without the model.
    """

    directory: Path
    given: Given
    explore: int = 0

    def build(self) -> Proposer:
        """The proposer."""
        model = load_trained(self.directory)
        prior, ratios = trained_prior(model.card), _given_images if self.given == "image" else _given_objects
        explorer = Explorer(SurfaceReader(network_camera()), OpenHand(robotiq_3f()), prior)

        def propose(shown: Shown, count: int, rng: np.random.Generator) -> Hands:
            explored = [explorer.propose(image, self.explore, rng) for image in shown.images]
            if self.explore == count:
                return _stacked(explored)
            proposed = [practice_hands(ratio, prior, count - self.explore, rng) for ratio in ratios(model, shown)]
            return _stacked([Hands.cat(pair) for pair in zip(proposed, explored, strict=True)])

        return propose

    def build_blind(self) -> BlindProposer:
        """The proposer that is told nothing."""
        model = load_trained(self.directory)
        prior, log_ratio = trained_prior(model.card), model.given_success()
        return lambda count, rng: blind_hands(log_ratio, prior, count, rng)


def _given_images(model: GraspModel, shown: Shown) -> list[LogDensity]:
    return [model.given_image(torch.from_numpy(image)[None]) for image in shown.images]


def _given_objects(model: GraspModel, shown: Shown) -> list[LogDensity]:
    scenes = shown.scenes
    known = zip(scenes.object_index, scenes.scale, scenes.object_pose, shown.friction, strict=True)
    return [model.given_object(int(o), float(s), (p[0], p[1], p[2]), float(mu)) for o, s, p, mu in known]


def _stacked(hands: Sequence[Hands]) -> Hands:
    """Hands of n scenes, k for each, batch shape (n, k)."""
    return Hands(*(torch.stack([getattr(h, name) for h in hands]) for name in ("position", "rotation", "grasp_type")))
