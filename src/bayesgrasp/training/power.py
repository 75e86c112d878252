r"""One number after training: how far the learned ratio is to be trusted.

A classifier that learned from finitely many successes makes posteriors that are too narrow, or, held back too much, too
wide. A power of its ratio repairs the scale of the whole, and leaves the order of hands of equal prior as it is:

    p_a(h | S=1, i) = r(i, h)^a p(h) / Z_a(i),     Z_a(i) = E_{p(h)} r(i, h)^a,
    a* = argmax_a  E_{p(h, i | S=1)} log p_a(h | S=1, i).

The mean runs over successes of held-out scenes, by weight, the expectation in Z over draws from the prior. Its
logarithm is concave in a, so there is one maximum; at the true ratio it is a = 1.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from jaxtyping import Float64
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp
from torch import nn

from bayesgrasp.data.schema import Batch
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.seeding import Stream, generator

LEAST, MOST = 0.1, 5.0
DRAWS = 2000


def posterior_power(
    estimator: nn.Module, batches: Iterable[Batch], prior: GraspPrior, seed: int = 0, draws: int = DRAWS
) -> float:
    """The power a* of p(S=1 | i, h) for an estimator of it.

    Args:
        estimator: On the CPU, in evaluation mode.
        batches: Held-out scenes.
        prior: p(h).
        seed: Of the draws from the prior.
        draws: For every scene.

    Returns:
        a*, or 1 where no held-out scene has a success of positive weight.
    """
    rows = [
        row for number, batch in enumerate(batches) for row in _log_ratios(estimator, batch, prior, draws, seed, number)
    ]
    if not rows:
        return 1.0
    return fit_power(*(np.stack(column) for column in zip(*rows, strict=True)))


def fit_power(
    truth: Float64[np.ndarray, "n"], weight: Float64[np.ndarray, "n"], drawn: Float64[np.ndarray, "n m"]
) -> float:
    """Maximise the mean log posterior of the truths over the power.

    Args:
        truth: Log-ratios of the truths; where several share an image, their weighted mean.
        weight: Of the truths.
        drawn: Log-ratios of draws from the prior for the same images.
    """

    def loss(power: float) -> float:
        log_posterior = power * truth - logsumexp(power * drawn, axis=1)
        return -float((weight * log_posterior).sum() / weight.sum())

    return float(minimize_scalar(loss, bounds=(LEAST, MOST), method="bounded").x)


def _log_ratios(
    estimator: Any, batch: Batch, prior: GraspPrior, draws: int, seed: int, number: int
) -> list[tuple[Any, ...]]:
    """For each scene with successes: their mean log-ratio, their total weight, log-ratios of draws from the prior."""
    tensors = batch.to("cpu")
    counts = (tensors.success * tensors.weight).double().numpy()
    found: list[tuple[Any, ...]] = []
    with torch.no_grad():
        for scene in np.flatnonzero(counts.sum(-1)):
            context = estimator.encode(tensors.images[scene : scene + 1])
            own = F.logsigmoid(estimator(context, tensors.hands[scene : scene + 1])[0]).double().numpy()
            tried = prior.sample(draws, generator(seed, Stream.POWER, number, int(scene)))[None]
            drawn = F.logsigmoid(estimator(context, tried)[0]).double().numpy()
            total = counts[scene].sum()
            found.append(((counts[scene] * own).sum() / total, total, drawn))
    return found
