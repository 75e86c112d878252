"""Between a model and the one that it was trained further from: ``bayesgrasp mix``.

A network that is trained further on wider data forgets some of what it knew of narrower data. Its weights and those
that it started from lie in one valley of the loss, and a point between them keeps most of both (Wortsman et al.,
"Robust fine-tuning of zero-shot models", CVPR 2022): w = (1 - s) w_further + s w_start, for every weight.
"""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor, nn

from bayesgrasp.errors import CheckpointError, InvalidConfigurationError
from bayesgrasp.locks import sole_writer
from bayesgrasp.ratio.card import CARD, write_card
from bayesgrasp.ratio.checkpoint import load_model, save_estimators
from bayesgrasp.training.train_model import weights_for


def mix(model: Path, start: Path, share: float, out: Path) -> None:
    """Write a model whose weights are between those of two.

    Args:
        model: Directory of a model; the new card is its card, without what plans delivered.
        start: Of the model that its training started from, or of an earlier one. Local evidence may be looked up at
            fewer points.
        share: s, from 0 (`model` as it is) to 1.
        out: Directory of the new model.

    Raises:
        CheckpointError: A model is missing or damaged, its weights do not fit the other's, or there is one in ``out``.
        InvalidConfigurationError: Another share.
    """
    if not 0 <= share <= 1:
        raise InvalidConfigurationError(f"a share is between 0 and 1, got {share}")
    if (out / CARD).exists():
        raise CheckpointError(f"{out} holds a model already: give another directory")
    further, earlier = load_model(model), load_model(start)
    card = {name: value for name, value in further.card.items() if name != "delivery"}
    for role in further.estimators.keys() & earlier.estimators.keys():
        _move(
            further.estimators[role], earlier.estimators[role], share, f"the {role} estimators of {model} and {start}"
        )
    with sole_writer(out):
        entries = save_estimators(out, further.estimators, card["estimators"])
        write_card(out, card | {"estimators": entries})


def _move(estimator: nn.Module, earlier: nn.Module, share: float, what: str) -> None:
    """Move the weights of an estimator towards those of an earlier one; counters stay."""
    mine: dict[str, Tensor] = estimator.state_dict()
    theirs = weights_for(estimator, earlier)
    if {name: value.shape for name, value in mine.items()} != {name: value.shape for name, value in theirs.items()}:
        raise CheckpointError(f"{what} differ in shape and cannot be mixed")
    for name, value in mine.items():
        if value.is_floating_point():
            mine[name] = torch.lerp(value, theirs[name], share)
    estimator.load_state_dict(mine)
