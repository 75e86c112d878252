"""``bayesgrasp practice``: try a model's own proposals, for more training data where they matter."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from bayesgrasp.data.practice import Proposer
    from bayesgrasp.types import Hands

COPIES = 7
"""Random stream of the stretched copies: ``generator(seed, COPIES)``."""


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
) -> None:
    """Try the hands that a model proposes for new images, and keep the outcomes as training data.

    Give the result to `bayesgrasp train` beside the data that the model was trained on: the next model knows where the
    first one was wrong in its own favour.

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
    """
    from bayesgrasp.assets.catalogue import load_objects
    from bayesgrasp.assets.stretch import StretchConfig, with_copies
    from bayesgrasp.cli.generate import print_summary, progress_bar
    from bayesgrasp.data.engine import Run, open_store
    from bayesgrasp.data.generate import GenerateConfig, SimulatedWorld
    from bayesgrasp.data.pairing import PairingConfig
    from bayesgrasp.data.pool import LocalPool
    from bayesgrasp.data.practice import PracticeRecipe
    from bayesgrasp.data.provenance import describe
    from bayesgrasp.errors import InvalidConfigurationError
    from bayesgrasp.prior.scene import ScenePrior
    from bayesgrasp.seeding import generator

    if scenes < 1 or tries < 3:
        raise InvalidConfigurationError(f"practice needs at least 1 scene and 3 tries, got {scenes} and {tries}")
    config = GenerateConfig(
        proposal="prior",
        attempts_per_draw=tries,
        scenes_per_draw=1,
        draws_per_chunk=32,
        pairing=PairingConfig(hands=tries),
    )
    objects = with_copies(load_objects(split, ycb_dir), StretchConfig(copies, stretch), generator(seed, COPIES))
    world = SimulatedWorld(objects)
    scene = ScenePrior(len(world.objects))
    recipe = PracticeRecipe(world, config, seed, scene, ModelProposer(model.resolve()))
    store = open_store(out, describe(world, config, seed, scene, scenes * tries), resume)
    with progress_bar(scenes * tries) as observe:
        manifest = Run(store, recipe, scenes * tries, observe).execute(LocalPool(workers))
    print_summary(manifest, out)


@dataclass(frozen=True)
class ModelProposer:
    """Loads a model in the worker that uses it.

    Attributes:
        directory: Of the model.
    """

    directory: Path

    def __call__(self) -> Proposer:
        """The proposer."""
        import torch

        from bayesgrasp.posterior.practice import practice_hands
        from bayesgrasp.prior.grasp import GraspPrior
        from bayesgrasp.ratio.checkpoint import load_model
        from bayesgrasp.types import Hands

        model, prior = load_model(self.directory), GraspPrior()

        def propose(images: np.ndarray, count: int, rng: np.random.Generator) -> Hands:
            hands = [
                practice_hands(model.given_image(torch.from_numpy(image)[None]), prior, count, rng) for image in images
            ]
            return Hands(
                torch.stack([h.position for h in hands]),
                torch.stack([h.rotation for h in hands]),
                torch.stack([h.grasp_type for h in hands]),
            )

        return propose
