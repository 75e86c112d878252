"""Is a trained posterior right? Judged by successes that it has not seen: ``bayesgrasp diagnose``.

Observation k uses the random streams of k, whoever judges it, so the report is the same for any number of processes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from bayesgrasp.diagnostics.posterior_report import Judged, Observation, Report, judge, report
from bayesgrasp.diagnostics.reliability import Reliability, ensemble_spread, reliability
from bayesgrasp.generation.pool import Work, processes
from bayesgrasp.geometry.grasp_space import GraspSpace
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.seeding import Stream, generator, torch_generator
from bayesgrasp.types import Hands
from bayesgrasp.workflows.load import load_trained, success_probability, trained_prior
from bayesgrasp.workflows.success_pairs import Attempted, SuccessPairs

DRAWS = 100
"""Posterior draws per observation, for ranks."""
BINS = 20
"""Of the reliability of the success probability."""

Verdict = tuple[Judged, list[float]]
"""The judgement of one observation, and the log-ratio of every model at its truth."""


@dataclass(frozen=True)
class CalibrationJob:
    """What is judged, and how.

    Attributes:
        models: Directories; the first is judged, all of them give the spread.
        proposals: Draws from the prior behind every posterior.
        seed: Of all random numbers.

    Raises:
        CheckpointError: A model is missing or damaged.
    """

    models: tuple[Path, ...]
    proposals: int = 10_000
    seed: int = 0

    def __post_init__(self) -> None:
        for directory in self.models:
            load_trained(directory)  # refused before the work, not after it


def calibrate(
    job: CalibrationJob,
    pairs: SuccessPairs,
    attempted: Iterable[Attempted],
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Report:
    """Expected coverage, simulation-based calibration, TARP, reliability, and the spread of an ensemble.

    Args:
        job: What is judged.
        pairs: Successes with an image each, which the models have not seen.
        attempted: Hands of all outcomes, for the reliability of the success probability.
        workers: Processes.
        progress: Told the number of posteriors that are judged.
    """
    verdicts: dict[int, Verdict] = {}
    rows = range(len(pairs.images))
    with processes(min(workers, len(rows))).start(_Judging(job, pairs).start) as judged:
        for row, verdict in judged(rows):
            verdicts[row] = verdict
            if progress is not None:
                progress(len(verdicts))
    model = load_trained(job.models[0])
    reliable = _reliability(model, attempted)
    rng = generator(job.seed, Stream.REFERENCE)
    references = trained_prior(model.card).sample(len(rows), rng)
    judgements, values = [verdicts[row][0] for row in rows], [verdicts[row][1] for row in rows]
    return report(pairs.hands, judgements, references, GraspSpace().distance, rng, reliable, _spread(values))


@dataclass(frozen=True)
class _Judging:
    """What a process judges; picklable."""

    job: CalibrationJob
    pairs: SuccessPairs

    def start(self) -> Work[int, tuple[int, Verdict]]:
        """The function that judges an observation, given its number; called once in each worker."""
        models = [load_trained(directory) for directory in self.job.models]
        prior = trained_prior(models[0].card)
        return lambda row: (row, self._verdict(row, models, prior))

    def _verdict(self, row: int, models: Sequence[GraspModel], prior: GraspPrior) -> Verdict:
        image, truth = self.pairs.images[row], self.pairs.hands[row]
        ratios = [model.given_image(image) for model in models]
        tried = prior.sample(self.job.proposals, generator(self.job.seed, Stream.DIAGNOSED_PRIOR, row))

        def log_posterior(hands: Hands) -> Tensor:
            return ratios[0](hands) + prior.log_prob(hands)

        observation = Observation(truth, log_posterior, tried, prior.log_prob(tried))
        with torch.no_grad():
            values = [ratio(truth).item() for ratio in ratios]
        return judge(observation, DRAWS, torch_generator(self.job.seed, Stream.DIAGNOSED_RANK, row)), values


def _reliability(model: GraspModel, attempted: Iterable[Attempted]) -> Reliability:
    """Of p(S=1 | i, h) at hands from the prior."""
    probability_of, parts = success_probability(model), []
    for some in attempted:
        with torch.no_grad():
            ratios = [model.given_image(image)(some.hands[i]) for i, image in enumerate(some.images)]
        parts.append(torch.stack([probability_of(torch.stack(ratios)), some.success, some.weight]).flatten(1))
    probability, success, weight = torch.cat(parts, 1).double().numpy()
    return reliability(np.clip(probability, 0, 1), success, weight, bins=BINS)


def _spread(values: list[list[float]]) -> np.ndarray | None:
    """Disagreement of the models at the truths; None for a single model."""
    members = np.array(values).T
    return ensemble_spread(members) if len(members) > 1 else None
