"""``bayesgrasp mix``: a model between one and the one that its training started from."""

from __future__ import annotations

from pathlib import Path

from bayesgrasp.training.mix import mix as run
from bayesgrasp.workflows.load import model_directory


def mix(model: Path, start: Path, out: Path, share: float = 0.25) -> None:
    """Mix the weights of a model with those that its training started from.

    A model that was trained further on wider data forgets some of what it knew; one between it and its start keeps most
    of both.

    Args:
        model: Directory of a model, or the name of one that comes with the package.
        start: Directory or name of the model that its training started from.
        out: Directory of the new model.
        share: Of the start in the new weights, from 0 to 1.
    """
    run(model_directory(model), model_directory(start), share, out)
    print(f"model written to {out}")
