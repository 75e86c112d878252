r"""Practice without an image: attempts at the hands that a model holds to be best when nothing is known of the scene.

p(S = 1 | h) is rarely tested where it matters: of a million draws from the prior, some thirty are near the best hand. A
network that is smooth enough for the rest of the space is wrong there, and a search finds the places where it is wrong
in its own favour. Here hands come from q(h), whatever a proposer makes of the model, and every one of them is tried in
a scene of its own. S given h is right for any q, because h knows nothing of the scene:

    p(S = 1 | h) = \int p(S = 1 | h, O, p_O) p(O) p(p_O) dO dp_O     with or without h ~ q(h).

So these attempts may be added to the training of p(S = 1 | h). They do not follow the prior, and q has no known
density: ``log_weight`` is -inf, and nothing that needs densities may learn from them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayesgrasp.data.images import to_units
from bayesgrasp.data.schema import AttemptRecords, HandRecords, SceneRecords
from bayesgrasp.data.shards import Chunk
from bayesgrasp.generation.chunks import GenerateConfig, World, labels
from bayesgrasp.generation.run import Done, Recipe, Task, finish
from bayesgrasp.geometry.camera import IMAGE_SHAPE
from bayesgrasp.geometry.hand_arrays import attempts_of
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Hands

BlindProposer = Callable[[int, np.random.Generator], Hands]
"""q(h): so many hands, batch shape (n,)."""


@dataclass(frozen=True)
class BlindRecipe(Recipe):
    """A `Recipe` whose hands come from a proposer that sees nothing.

    Attributes:
        propose: Makes the proposer, once in each worker.
    """

    propose: Callable[[], BlindProposer]

    def start(self) -> Callable[[Task], Done]:
        """The function that a worker runs for every task."""
        maker = BlindMaker(self.build(), self.propose(), self.config, self.seed, self.scene)
        return lambda task: finish(maker.make(task.chunk, task.rows), task.chunk)


class BlindMaker:
    """Makes chunks of practice without images: every attempt is an object draw of its own.

    Args:
        world: The simulators.
        propose: q(h).
        config: Sizes and priors; ``attempts_per_draw`` is 1.
        seed: Of the data set.
        scene: p(O) p(p_O).
    """

    def __init__(
        self, world: World, propose: BlindProposer, config: GenerateConfig, seed: int, scene: ScenePrior
    ) -> None:
        self.world, self.propose, self.config, self.seed, self.scene = world, propose, config, seed, scene

    def make(self, chunk: int, rows: int) -> Chunk:
        """The first ``rows`` attempts of a chunk."""
        rng = generator(self.seed, Stream.PRACTICE, chunk)
        hands = self.propose(rows, generator(self.seed, Stream.PRACTICE_HANDS, chunk))
        attempts = attempts_of(hands, self.scene.sample(rows, rng), self.config.nuisance.sample(rows, rng))
        records = AttemptRecords(
            **attempts.columns(),
            draw=chunk * self.config.draws_per_chunk + np.arange(rows),
            **labels(self.world.lift_test(attempts)),
            log_weight=np.full(rows, -np.inf, np.float32),
            object_log_weight=np.zeros(rows, np.float32),
        )
        return Chunk(records, self._no_pictures(rng), HandRecords.none(self.config.pairing.hands))

    def _no_pictures(self, rng: np.random.Generator) -> SceneRecords:
        cameras = self.config.camera.sample(0, rng).actual.columns()
        columns = {f"camera_{name}": column for name, column in cameras.items()}
        image = to_units(np.zeros((0, *IMAGE_SHAPE), np.float32))
        return SceneRecords(**self.scene.sample(0, rng).columns(), draw=np.zeros(0, np.int64), **columns, image=image)
