"""What `bayesgrasp diagnose` judges by: successes with an image each, and attempts of all outcomes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float
    from torch import Tensor

    from bayesgrasp.data.loader import GraspDataset, Split
    from bayesgrasp.generation.trials import Trials
    from bayesgrasp.types import Hands

FAILURES = 4
"""Failures shown for each fresh success."""


@dataclass(frozen=True)
class Truths:
    """Draws from p(h, i | S=1).

    Attributes:
        images: (n, 1, height, width), metres, 0 = no return.
        hands: (n,).
    """

    images: Float[Tensor, "n 1 height width"]
    hands: Hands


@dataclass(frozen=True)
class Tried:
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


def stored(dataset: GraspDataset, split: Split, count: int, rng: np.random.Generator) -> tuple[Truths, Iterator[Tried]]:
    """From a data set: successful hands of its scenes, drawn by weight, and all of its hands.

    Raises:
        DataError: The split has no successful hand.
    """
    import numpy as np
    import torch

    from bayesgrasp.types import Hands

    loader = dataset.scenes(split, batch_size=16, shuffle=False)
    pairs = [(loader.batch(np.array([row])), column) for row, column in _successes(dataset, split, count, rng)]
    hands = Hands.cat([batch.hands[0, column : column + 1] for batch, column in pairs])
    truths = Truths(torch.cat([batch.images for batch, _ in pairs]), hands)
    return truths, (Tried(b.images, b.hands, b.success, b.weight) for b in loader(0))


def fresh(split: str, ycb_dir: Path | None, count: int, seed: int, workers: int) -> tuple[Truths, Iterator[Tried]]:
    """From new simulations under the prior: equally likely successes, each with an image of its own scene."""
    import torch

    from bayesgrasp.cli.counting import progress_bar
    from bayesgrasp.generation.fresh_pairs import fresh_pairs
    from bayesgrasp.geometry.hand_arrays import hands_of
    from bayesgrasp.objects.catalogue import load_objects

    found = 0
    with progress_bar("successes", count) as advance:

        def observe(trials: Trials) -> None:
            nonlocal found
            found += trials.successes
            advance(found)

        pairs = fresh_pairs(load_objects(split, ycb_dir), count, FAILURES * count, seed, workers, observe)
    images, hands = torch.from_numpy(pairs.images)[:, None], hands_of(pairs.attempts)
    success, weight = torch.from_numpy(pairs.success)[:, None], torch.from_numpy(pairs.weight)[:, None]
    truths = Truths(images[:count], hands[:count])
    rows = torch.arange(len(images)).split(16)
    return truths, (Tried(images[r], hands[r][:, None], success[r], weight[r]) for r in rows)


def _successes(dataset: GraspDataset, split: Split, count: int, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Scenes and columns of successful hands, drawn by weight, so that they follow p(h, i | S=1)."""
    import numpy as np

    from bayesgrasp.errors import DataError
    from bayesgrasp.types import Outcome

    rows, columns = dataset.scenes(split).rows, dataset.scene_columns
    weight = columns["hand_weight"][rows] * (columns["hand_outcome"][rows] == Outcome.SUCCESS)
    scene, hand = np.nonzero(weight)
    if len(scene) == 0:
        raise DataError(f"the {split} scenes of {dataset.store.directory} have no successful hand; generate more")
    share = weight[scene, hand].astype(np.float64)
    chosen = rng.choice(len(scene), min(count, len(scene)), p=share / share.sum())
    return [(int(rows[scene[i]]), int(hand[i])) for i in chosen]
