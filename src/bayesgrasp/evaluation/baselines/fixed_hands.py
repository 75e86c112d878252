"""What can be had without an image: one hand for every scene, the best one found in the simulator itself.

A strategy that sees nothing chooses one hand for all scenes, so no strategy beats the best fixed hand, whose success
rate is max_h p(S=1 | h). It is looked for by successive halving (Karnin, Koren, Somekh 2013): all hands of a round are
tried in the same scenes, those with the highest rates so far stay, and fewer hands get more scenes. The rate of the
winner in the scenes that it won in is too high; it is measured again in scenes of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import Bool, UInt8

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.scenes import ScenePriors
from bayesgrasp.geometry.hand_arrays import attempts_of
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Attempts, Hands, Nuisances, Outcome, Scenes

Judge = Callable[[Attempts], UInt8[np.ndarray, "n"]]
"""The lift test: an `Outcome` for each attempt."""


@dataclass(frozen=True)
class Round:
    """One round of halving.

    Attributes:
        scenes: Scenes that every hand of the round is tried in.
        kept: Hands that go on.
    """

    scenes: int
    kept: int


@dataclass(frozen=True)
class Blindfold:
    """Scenes of which nothing is known, and the lift test in them.

    Attributes:
        judge: The lift test of the object set.
        objects: Size of the object set; objects take turns, so that each has the same number of scenes (to one).
        seed: Of the scenes.
        priors: Where they come from.
    """

    judge: Judge
    objects: int
    seed: int
    priors: ScenePriors = field(default_factory=ScenePriors)

    def scenes(self, count: int, number: int) -> tuple[Scenes, Nuisances]:
        """The scenes of a round."""
        rng = generator(self.seed, Stream.FIXED_HAND, number)
        scenes = replace(self.priors.scene, num_objects=self.objects, weights=None).sample(count, rng)
        turns = (np.arange(count) % self.objects).astype(np.int32)
        return replace(scenes, object_index=turns), self.priors.nuisance.sample(count, rng)

    def succeed(self, hands: Hands, count: int, number: int) -> Bool[np.ndarray, "hands scenes"]:
        """Which hands, of batch shape (n,), succeed in which scenes of a round."""
        scenes, nuisances = self.scenes(count, number)
        hand, scene = (index.ravel() for index in np.indices((len(hands.grasp_type), count)))
        attempts = attempts_of(hands[torch.from_numpy(hand)], scenes[scene], nuisances[scene])
        won: Bool[np.ndarray, "hands scenes"] = (self.judge(attempts) == Outcome.SUCCESS).reshape(-1, count)
        return won


def halve(hands: Hands, blindfold: Blindfold, rounds: Sequence[Round]) -> Hands:
    """The hands that are left after all rounds, the best one first.

    Args:
        hands: Candidates, batch shape (n,).
        blindfold: The scenes and the lift test.
        rounds: One after another; round i uses the scenes of number i.

    Raises:
        InvalidConfigurationError: No rounds, or one that keeps or tries nothing.
    """
    if not rounds or min(min(one.scenes, one.kept) for one in rounds) < 1:
        raise InvalidConfigurationError(f"halving needs rounds with at least one scene and one hand kept, got {rounds}")
    left = np.arange(len(hands.grasp_type))
    won, tried = np.zeros(len(left)), np.zeros(len(left))
    for number, one in enumerate(rounds):
        won[left] += blindfold.succeed(hands[torch.from_numpy(left)], one.scenes, number).sum(-1)
        tried[left] += one.scenes
        order = np.argsort(-won[left] / tried[left], kind="stable")
        left = left[order[: one.kept]]
    return hands[torch.from_numpy(left)]
