r"""How many independent hands the successes in a data set's scenes are worth.

A weighted sample of n hands estimates a mean as well as (\sum w)^2 / \sum w^2 unweighted ones would: its effective
sample size (Kish 1965). The scenes of a draw share their successes, each moved into every scene, so weights are also
summed over all scenes before: that is the number of independent *attempts*, which more scenes cannot raise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Shaped

from bayesgrasp.data.cache import Columns
from bayesgrasp.types import Outcome


@dataclass(frozen=True)
class Effective:
    """Successful hands in scenes, of one object or of all.

    Attributes:
        hands: How many hands of scenes are successes.
        by_weight: Their effective number by ``weight`` (densities).
        by_selection: The same by ``selection_weight`` (p(S = 1 | i, h)).
        attempts: Different attempts that they come from.
        attempts_by_weight, attempts_by_selection: Their effective numbers, weights summed over scenes.
    """

    hands: int
    by_weight: float
    by_selection: float
    attempts: int
    attempts_by_weight: float
    attempts_by_selection: float


def effective_size(weight: Float[np.ndarray, "n"]) -> float:
    """(sum w)^2 / sum w^2; 0 for no weight at all."""
    w = weight.astype(np.float64)
    square = float((w**2).sum())
    return float(w.sum()) ** 2 / square if square > 0 else 0.0


def effective_successes(scenes: Columns, object_index: int | None = None) -> Effective:
    """Of the scenes of a data set (`GraspDataset.scene_columns`), or of those with one object."""
    chosen = scenes["hand_outcome"] == Outcome.SUCCESS
    if object_index is not None:
        chosen &= (scenes["object_index"] == object_index)[:, None]
    places = np.nonzero(chosen)
    source = np.stack([scenes["draw"][places[0]], scenes["hand_source"][places].astype(np.int64)], axis=1)
    weight, selection = scenes["hand_weight"][places], scenes["hand_selection_weight"][places]
    return Effective(
        hands=len(source),
        by_weight=effective_size(weight),
        by_selection=effective_size(selection),
        attempts=len(np.unique(source, axis=0)),
        attempts_by_weight=effective_size(_summed(weight, source)),
        attempts_by_selection=effective_size(_summed(selection, source)),
    )


def _summed(weight: Float[np.ndarray, "n"], source: Shaped[np.ndarray, "n 2"]) -> Float[np.ndarray, "m"]:
    """Weights summed over the hands that come from the same attempt."""
    _, group = np.unique(source, axis=0, return_inverse=True)
    return np.bincount(group.reshape(-1), weight).astype(np.float64)  # of nothing it would be integers
