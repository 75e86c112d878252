"""Tests of accuracy with random points (TARP; Lemos et al. 2023), with the geodesic distance on R^3 x SO(3) x G.

For a random reference point h_r, the ball around it that reaches the truth holds the posterior mass

    f = P(d(h, h_r) < d(h*, h_r)),    h ~ p(h | S=1, i).

f is uniform for the right posterior, whatever the reference, and, unlike highest-density coverage, uniform for all
references only for the right one. No density is needed, only draws. Wide and narrow posteriors both leave the
diagonal: too narrow gives a slope above 1 at both ends (f near 0 and 1), too wide the opposite.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from torch import Tensor

from bayesgrasp.diagnostics.sbc import Ranks, sbc_ranks
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.types import Hands

Distance = Callable[[Hands, Hands], Tensor]


def tarp_ranks(truth: Hands, draws: Hands, references: Hands, distance: Distance, rng: np.random.Generator) -> Ranks:
    """Rank of the truth's distance from the reference among those of the draws.

    Args:
        truth: (n,) hands that the observations come from.
        draws: (n, m) posterior draws.
        references: (n,) reference points, drawn independently of truth and observation (from the prior, say).
        distance: Geodesic distance, broadcasting over batch shapes; `GraspSpace.distance`.
        rng: Orders ties.

    Raises:
        InvalidConfigurationError: Shapes that do not belong together.
    """
    if truth.shape != references.shape or truth.shape != draws.shape[:-1]:
        shapes = [tuple(hands.shape) for hands in (truth, draws, references)]
        raise InvalidConfigurationError(f"TARP needs shapes (n,), (n, m) and (n,), got {shapes}")
    known = _numbers(distance(truth, references))
    drawn = _numbers(distance(draws, references[:, None]))
    return sbc_ranks(known, drawn, rng)


def _numbers(values: Tensor) -> Float[np.ndarray, "..."]:
    return values.detach().cpu().double().numpy()
