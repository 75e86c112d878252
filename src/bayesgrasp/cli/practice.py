"""``bayesgrasp practice``: try a model's own proposals, for more training data where they matter."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np

    from bayesgrasp.data.store import Given
    from bayesgrasp.generation.practice import Proposer, Shown
    from bayesgrasp.posterior.potential import LogDensity
    from bayesgrasp.ratio.model import GraspModel
    from bayesgrasp.types import Hands


def practice(
    model: Path,
    out: Path,
    scenes: int = 2000,
    tries: int = 12,
    seed: int = 0,
    workers: int = os.cpu_count() or 1,
    resume: bool = False,
    split: str = "train",
    ycb_dir: Path | None = None,
    copies: int = 0,
    stretch: float = 1.3,
    estimator: Literal["success", "full"] = "success",
) -> None:
    """Try the hands that a model proposes for new scenes, and keep the outcomes as training data.

    Give the result to `bayesgrasp train` beside the data that the model was trained on: the next model knows where the
    first one was wrong in its own favour. Practice of `success` teaches `success` and `full`, that of `full` only
    `full`.

    Args:
        model: Directory of the model.
        out: Directory of the new data set.
        scenes: How many images.
        tries: Hands tried for each image, at least 3.
        seed: Of all random numbers.
        workers: Processes.
        resume: Go on with the data set in --out, or start it where there is none.
        split: Objects; see `bayesgrasp generate`. Never the unseen ones if they are to stay unseen.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        copies: Stretched copies of each object that are practised on beside it, for more shapes than there are scans.
        stretch: Each axis of a copy is multiplied by a factor between 1 / stretch and stretch.
        estimator: Which estimator proposes: success (it sees the image) or full (it knows object, pose and friction).
    """
    from bayesgrasp.cli.generate import print_summary, progress_bar
    from bayesgrasp.errors import InvalidConfigurationError
    from bayesgrasp.generation.chunks import GenerateConfig, SimulatedWorld
    from bayesgrasp.generation.pairing import PairingConfig
    from bayesgrasp.generation.pool import LocalPool
    from bayesgrasp.generation.practice import PracticeRecipe
    from bayesgrasp.generation.provenance import describe
    from bayesgrasp.generation.run import Run, open_store
    from bayesgrasp.objects.catalogue import load_objects
    from bayesgrasp.objects.stretch import StretchConfig, with_copies
    from bayesgrasp.prior.scene import ScenePrior
    from bayesgrasp.seeding import Stream, generator

    if scenes < 1 or tries < 3:
        raise InvalidConfigurationError(f"practice needs at least 1 scene and 3 tries, got {scenes} and {tries}")
    config = GenerateConfig(
        proposal="prior",
        attempts_per_draw=tries,
        scenes_per_draw=1,
        draws_per_chunk=32,
        pairing=PairingConfig(hands=tries),
    )
    objects = with_copies(load_objects(split, ycb_dir), StretchConfig(copies, stretch), generator(seed, Stream.COPIES))
    world = SimulatedWorld(objects)
    scene = ScenePrior(len(world.objects))
    manifest = describe(world, config, seed, scene, scenes * tries)
    if estimator == "full":
        _check_objects(model, tuple(asset.id for asset in objects))
        manifest = replace(manifest, config=manifest.config | {"practice": {"given": "object"}})
    proposer = ModelProposer(model.resolve(), manifest.given)
    recipe = PracticeRecipe(world.build, config, seed, scene, proposer, manifest.given)
    store = open_store(out, manifest, resume)
    with progress_bar(scenes * tries) as observe:
        finished = Run(store, recipe, scenes * tries, observe).execute(LocalPool(workers))
    print_summary(finished, out)


def _check_objects(model: Path, ids: tuple[str, ...]) -> None:
    """An estimator that is told the mesh by its number must have been trained on the same objects."""
    from bayesgrasp.errors import InvalidConfigurationError
    from bayesgrasp.ratio.checkpoint import read_card

    known = tuple(read_card(model).get("objects", ()))
    if known != ids:
        raise InvalidConfigurationError(
            f"the full-observation estimator of {model} knows the objects {', '.join(known) or 'of no list'}; practise "
            "on the split that it was trained on, with --copies 0"
        )


@dataclass(frozen=True)
class ModelProposer:
    """q(h | i), or q(h | O, p_O, beta, mu), of a model that is loaded in the worker that uses it.

    Attributes:
        directory: Of the model.
        given: What the model is told of a scene.
    """

    directory: Path
    given: Given

    def __call__(self) -> Proposer:
        """The proposer."""
        from bayesgrasp.ratio.checkpoint import load_model

        model = load_model(self.directory)
        ratios = _given_images if self.given == "image" else _given_objects

        def propose(shown: Shown, count: int, rng: np.random.Generator) -> Hands:
            return _propose(ratios(model, shown), count, rng)

        return propose


def _given_images(model: GraspModel, shown: Shown) -> list[LogDensity]:
    import torch

    return [model.given_image(torch.from_numpy(image)[None]) for image in shown.images]


def _given_objects(model: GraspModel, shown: Shown) -> list[LogDensity]:
    scenes = shown.scenes
    known = zip(scenes.object_index, scenes.scale, scenes.object_pose, shown.friction, strict=True)
    return [model.given_object(int(o), float(s), (p[0], p[1], p[2]), float(mu)) for o, s, p, mu in known]


def _propose(ratios: Sequence[LogDensity], count: int, rng: np.random.Generator) -> Hands:
    """Hands for each scene, (n, count), by the log-ratio of each."""
    import torch

    from bayesgrasp.posterior.practice_hands import practice_hands
    from bayesgrasp.prior.grasp import GraspPrior
    from bayesgrasp.types import Hands

    hands = [practice_hands(ratio, GraspPrior(), count, rng) for ratio in ratios]
    return Hands(*(torch.stack([getattr(h, name) for h in hands]) for name in ("position", "rotation", "grasp_type")))
