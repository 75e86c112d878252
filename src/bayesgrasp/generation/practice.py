r"""Practice: attempts at the hands that a model itself proposes for a scene.

A classifier that was trained on draws from the prior and near successes is asked for its maximum later, and a search
finds the places where it is wrong in its own favour. Here the hands of a scene come from q(h | i), whatever a proposer
makes of the image, and are tried on the object that the image shows. S given (h, i) is right for any q, because h
depends on the scene through the image alone:

    p(S = 1 | i, h) = \int p(S = 1 | h, O, p_O) p(O, p_O | i) dO dp_O    with or without h ~ q(h | i).

So these pairs may be added to the training of p(S = 1 | i, h), with ``selection_weight`` 1. They do not follow the
prior, and q has no known density: ``weight`` is 0, and estimators that need densities learn nothing from them.

The full-observation estimator proposes from what it is told, q(h | O, p_O, beta, mu), with one friction for all hands
of a scene. By the same argument these pairs teach p(S = 1 | O, p_O, beta, mu, h). They do not teach p(S = 1 | i, h):
such hands know more of the object than its image shows. The manifest says which (`Manifest.given`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32

from bayesgrasp.data.images import to_units
from bayesgrasp.data.manifest import Given
from bayesgrasp.data.schema import AttemptRecords, HandRecords, SceneRecords
from bayesgrasp.data.shards import Chunk
from bayesgrasp.generation.chunks import GenerateConfig, World, labels
from bayesgrasp.generation.run import Done, Recipe, Task, finish
from bayesgrasp.geometry.hand_arrays import attempts_of
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Hands, Scenes


@dataclass(frozen=True)
class Shown:
    """What a proposer is shown of n scenes; it must look at what its set is said to be given, and at nothing else.

    Attributes:
        images: Depth in metres, 0 = no return.
        scenes: O, beta and p_O.
        friction: Lateral friction coefficient.
    """

    images: Float32[np.ndarray, "n 160 256"]
    scenes: Scenes
    friction: Float32[np.ndarray, "n"]


Proposer = Callable[[Shown, int, np.random.Generator], Hands]
"""q(h | i) or q(h | O, p_O, beta, mu): hands of batch shape (n, k) for n scenes, k for each."""


@dataclass(frozen=True)
class PracticeRecipe(Recipe):
    """A `Recipe` whose hands come from a proposer.

    Attributes:
        propose: Makes the proposer, once in each worker.
        given: What it looks at.
    """

    propose: Callable[[], Proposer]
    given: Given = "image"

    def start(self) -> Callable[[Task], Done]:
        """The function that a worker runs for every task."""
        maker = PracticeMaker(self.build(), self.propose(), self.config, self.seed, self.scene, self.given)
        return lambda task: finish(maker.make(task.chunk, task.rows), task.chunk)


class PracticeMaker:
    """Makes chunks of practice: one scene a draw, tried ``attempts_per_draw`` times.

    Args:
        world: The simulators.
        propose: q(h | i) or q(h | O, p_O, beta, mu).
        config: Sizes and priors; ``scenes_per_draw`` is 1.
        seed: Of the data set.
        scene: p(O) p(p_O).
        given: What the proposer looks at.
    """

    def __init__(
        self,
        world: World,
        propose: Proposer,
        config: GenerateConfig,
        seed: int,
        scene: ScenePrior,
        given: Given = "image",
    ) -> None:
        self.world, self.propose, self.config, self.seed, self.scene = world, propose, config, seed, scene
        self.given = given

    def make(self, chunk: int, rows: int) -> Chunk:
        """The first ``rows`` attempts of a chunk, in whole scenes."""
        rng = generator(self.seed, Stream.PRACTICE, chunk)
        count, tries = -(-rows // self.config.attempts_per_draw), self.config.attempts_per_draw
        scenes, cameras = self.scene.sample(count, rng), self.config.camera.sample(count, rng)
        image = self.world.render(scenes, cameras, rng)
        told = generator(self.seed, Stream.PRACTICE_FRICTION, chunk)
        friction = self.config.nuisance.sample(count, told).lateral_friction
        proposing = generator(self.seed, Stream.PRACTICE_HANDS, chunk)
        proposed = self.propose(Shown(image, scenes, friction), tries, proposing)
        nuisances = self.config.nuisance.sample(count * tries, rng)
        attempts = attempts_of(proposed, scenes[np.repeat(np.arange(count), tries)], nuisances)
        if self.given == "object":
            attempts = replace(attempts, lateral_friction=np.repeat(friction, tries))
        draw = chunk * self.config.draws_per_chunk + np.arange(count)
        records = AttemptRecords(
            **attempts.columns(),
            draw=np.repeat(draw, tries),
            **labels(self.world.lift_test(attempts)),
            log_weight=np.full(len(attempts), -np.inf, np.float32),
            object_log_weight=np.zeros(len(attempts), np.float32),
        )
        columns = {f"camera_{name}": column for name, column in cameras.actual.columns().items()}
        pictures = SceneRecords(**scenes.columns(), draw=draw, **columns, image=to_units(image))
        return Chunk(records, pictures, _hands(records, count))


def _hands(records: AttemptRecords, scenes: int) -> HandRecords:
    """The attempts as the hands of their scenes."""
    columns = {name: column for name, column in records.columns().items() if name in HandRecords.__dataclass_fields__}
    tries = len(records) // scenes
    columns |= {
        "weight": np.zeros(len(records), np.float32),
        "selection_weight": np.ones(len(records), np.float32),
        "source": np.tile(np.arange(tries, dtype=np.int32), scenes),
    }
    return HandRecords(**{name: column.reshape(scenes, tries, *column.shape[1:]) for name, column in columns.items()})
