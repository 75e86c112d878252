"""All diagnostics of a posterior in one report: numbers as plain data, and figures.

What is judged comes in as arrays and callables, so a report can be made of any posterior, a known one too:

    truths      (h*, i) from p(h, i | S=1), with log p(h* | S=1, i) up to a constant of i
    proposals   for each i, draws with their log-density and their posterior weights (importance sampling)
    attempts    predicted p(S=1 | i, h) and simulated S
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from bayesgrasp.diagnostics.coverage import Coverage, expected_coverage, hpd_mass
from bayesgrasp.diagnostics.plots import plot_coverage, plot_ranks, plot_reliability, plot_spread
from bayesgrasp.diagnostics.reliability import Reliability
from bayesgrasp.diagnostics.sbc import Ranks, simulation_based_calibration
from bayesgrasp.diagnostics.tarp import Distance, tarp_ranks
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.types import Hands

LogDensity = Callable[[Hands], Tensor]


@dataclass(frozen=True)
class Observation:
    """One observation with its truth, and the posterior that is judged.

    Attributes:
        truth: h*, of batch shape ().
        log_posterior: Log-density at any hands, up to a constant.
        proposals: Draws from any distribution that covers the posterior, (m,).
        log_proposal: Their log-density under it, up to a constant, (m,).
    """

    truth: Hands
    log_posterior: LogDensity
    proposals: Hands
    log_proposal: Float[Tensor, "m"]


@dataclass(frozen=True)
class Judged:
    """What the tests need to know of one observation.

    Attributes:
        mass: Of the highest-density region that contains the truth.
        draws: Posterior draws, by importance resampling, (k,).
        effective_sample_size: Of the importance weights.
    """

    mass: float
    draws: Hands
    effective_sample_size: float


def judge(observation: Observation, draws: int, rng: torch.Generator) -> Judged:
    """Weigh the proposals, measure the truth's region, resample.

    Raises:
        InvalidConfigurationError: The posterior is NaN, or zero at every proposal.
    """
    with torch.no_grad():
        log_density = observation.log_posterior(observation.proposals).double()
        truth = observation.log_posterior(observation.truth[None]).double()
    # Importance weights p(h | S=1, i) / q(h), normalised, so that constants of either density do not matter.
    weight = torch.softmax(log_density - observation.log_proposal.double(), 0)
    if not bool(weight.isfinite().all()):
        raise InvalidConfigurationError("the log-posterior is not finite at any proposal, or is NaN at one")
    mass = hpd_mass(truth.numpy(), log_density.numpy()[None], weight.numpy()[None])[0]
    chosen = torch.multinomial(weight, draws, replacement=True, generator=rng)
    return Judged(float(mass), observation.proposals[chosen], float(1.0 / weight.square().sum()))


@dataclass(frozen=True)
class Report:
    """Results of all diagnostics; absent ones are None.

    Attributes:
        coverage: Of highest-density regions.
        sbc: Ranks by statistic.
        tarp: Ranks of distances from random points.
        reliability: Of the success probability.
        spread: Disagreement of an ensemble at hands from the prior, nats.
        effective_sample_size: Of the importance weights, median over observations.
    """

    coverage: Coverage
    sbc: Mapping[str, Ranks]
    tarp: Ranks
    reliability: Reliability | None
    spread: Float[np.ndarray, "n"] | None
    effective_sample_size: float

    def to_dict(self) -> dict[str, object]:
        """As JSON-able data."""
        content: dict[str, object] = {
            "expected_coverage": self.coverage.to_dict(),
            "sbc": {name: ranks.to_dict() for name, ranks in self.sbc.items()},
            "tarp": self.tarp.to_dict() | {"expected_coverage": expected_coverage(self.tarp.position).to_dict()},
            "reliability": None if self.reliability is None else self.reliability.to_dict(),
            "ensemble_spread": None if self.spread is None else _summary(self.spread),
            "effective_sample_size": self.effective_sample_size,
        }
        return content

    def draw(self, directory: Path) -> tuple[Path, ...]:
        """Write the figures; their paths."""
        paths = [directory / f"{name}.png" for name in ("coverage", "sbc", "tarp")]
        plot_coverage({"highest density": self.coverage, "TARP": expected_coverage(self.tarp.position)}, paths[0])
        plot_ranks(self.sbc, paths[1])
        plot_ranks({"distance": self.tarp}, paths[2])
        if self.reliability is not None:
            plot_reliability(self.reliability, directory / "reliability.png")
            paths.append(directory / "reliability.png")
        if self.spread is not None:
            plot_spread(self.spread, directory / "spread.png")
            paths.append(directory / "spread.png")
        return tuple(paths)


def report(
    truth: Hands,
    judged: list[Judged],
    references: Hands,
    distance: Distance,
    rng: np.random.Generator,
    reliability: Reliability | None = None,
    spread: Float[np.ndarray, "n"] | None = None,
) -> Report:
    """Put the tests together.

    Args:
        truth: (n,) truths, in the order of `judged`.
        judged: One for each observation.
        references: (n,) random points for TARP, independent of everything else.
        distance: Geodesic distance.
        rng: Orders ties.
        reliability: Of the success probability, where there is one.
        spread: Of an ensemble, where there is one.

    Raises:
        InvalidConfigurationError: No observations.
    """
    if not judged:
        raise InvalidConfigurationError("a report needs at least one observation with its truth")
    draws = Hands(*(torch.stack([getattr(j.draws, f) for j in judged]) for f in ("position", "rotation", "grasp_type")))
    return Report(
        coverage=expected_coverage(np.array([j.mass for j in judged])),
        sbc=simulation_based_calibration(truth, draws, rng),
        tarp=tarp_ranks(truth, draws, references, distance, rng),
        reliability=reliability,
        spread=spread,
        effective_sample_size=float(np.median([j.effective_sample_size for j in judged])),
    )


def _summary(values: Float[np.ndarray, "n"]) -> dict[str, float]:
    quantiles = np.quantile(values, (0.1, 0.5, 0.9))
    numbers = {f"quantile_{name}": float(value) for name, value in zip(("10", "50", "90"), quantiles, strict=True)}
    return {"mean": float(values.mean()), **numbers}
