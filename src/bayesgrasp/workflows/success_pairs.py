"""What a posterior is judged by: successes with an image each, and attempts of all outcomes.

They come from a data set, or from new simulations under the prior, which owe nothing to what training relied on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from bayesgrasp.data.loader import GraspDataset, Split
from bayesgrasp.errors import DataError
from bayesgrasp.generation.fresh_pairs import fresh_pairs
from bayesgrasp.generation.trials import Trials
from bayesgrasp.geometry.hand_arrays import hands_of
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.types import Hands, Outcome

FAILURES = 4
"""Failures shown for each fresh success."""
BATCH = 16
"""Images with their hands that are handed over at once."""


@dataclass(frozen=True)
class SuccessPairs:
    """Draws from p(h, i | S=1).

    Attributes:
        images: (n, 1, height, width), metres, 0 = no return.
        hands: (n,).
    """

    images: Float[Tensor, "n 1 height width"]
    hands: Hands


@dataclass(frozen=True)
class Attempted:
    """Images with hands of all outcomes, weighted to the prior.

    Attributes:
        images: (b, 1, height, width).
        hands: (b, k).
        success, weight: (b, k).
    """

    images: Float[Tensor, "b 1 height width"]
    hands: Hands
    success: Float[Tensor, "b k"]
    weight: Float[Tensor, "b k"]


def stored_pairs(
    dataset: GraspDataset, split: Split, count: int, rng: np.random.Generator
) -> tuple[SuccessPairs, Iterator[Attempted]]:
    """From a data set: successful hands of its scenes, drawn by weight, and all of its hands.

    Raises:
        DataError: The split has no successful hand.
    """
    loader = dataset.scenes(split, batch_size=BATCH, shuffle=False)
    pairs = [(loader.batch(np.array([row])), column) for row, column in _successes(dataset, split, count, rng)]
    hands = Hands.cat([batch.hands[0, column : column + 1] for batch, column in pairs])
    successes = SuccessPairs(torch.cat([batch.images for batch, _ in pairs]), hands)
    return successes, (Attempted(b.images, b.hands, b.success, b.weight) for b in loader.batches(0))


def simulated_pairs(
    objects: Sequence[ObjectAsset],
    count: int,
    seed: int,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> tuple[SuccessPairs, Iterator[Attempted]]:
    """From new simulations under the prior: equally likely successes, each with an image of its own scene.

    Args:
        objects: The object set.
        count: Successes.
        seed: Of all random numbers.
        workers: Processes.
        progress: Told the number of successes so far.
    """
    found = 0

    def observe(trials: Trials) -> None:
        nonlocal found
        found += trials.successes
        if progress is not None:
            progress(found)

    pairs = fresh_pairs(objects, count, FAILURES * count, seed, workers, observe)
    images, hands = torch.from_numpy(pairs.images)[:, None], hands_of(pairs.attempts)
    success, weight = torch.from_numpy(pairs.success)[:, None], torch.from_numpy(pairs.weight)[:, None]
    rows = torch.arange(len(images)).split(BATCH)
    attempted = (Attempted(images[r], hands[r][:, None], success[r], weight[r]) for r in rows)
    return SuccessPairs(images[:count], hands[:count]), attempted


def _successes(dataset: GraspDataset, split: Split, count: int, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Scenes and columns of successful hands, drawn by weight, so that they follow p(h, i | S=1)."""
    rows, columns = dataset.scenes(split).rows, dataset.scene_columns
    weight = columns["hand_weight"][rows] * (columns["hand_outcome"][rows] == Outcome.SUCCESS)
    scene, hand = np.nonzero(weight)
    if len(scene) == 0:
        raise DataError(f"the {split} scenes of {dataset.store.directory} have no successful hand; generate more")
    share = weight[scene, hand].astype(np.float64)
    chosen = rng.choice(len(scene), min(count, len(scene)), p=share / share.sum())
    return [(int(rows[scene[i]]), int(hand[i])) for i in chosen]
