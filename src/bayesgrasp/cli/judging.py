"""Judges posteriors on several processes: observation k uses the random streams of k, whoever judges it."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bayesgrasp.cli.counting import progress_bar

if TYPE_CHECKING:
    from torch import Tensor

    from bayesgrasp.cli.truths import Truths
    from bayesgrasp.diagnostics.posterior_report import Judged
    from bayesgrasp.types import Hands

    Verdict = tuple[Judged, list[float]]

DRAWS = 100
"""Posterior draws per observation, for ranks."""


@dataclass(frozen=True)
class Court:
    """What is judged, and how.

    Attributes:
        models: Directories; the first is judged, all of them give the spread.
        proposals: Draws from the prior behind every posterior.
        seed: Of all random numbers.
    """

    models: tuple[Path, ...]
    proposals: int
    seed: int


def judge_all(court: Court, truths: Truths, workers: int) -> tuple[list[Judged], list[list[float]]]:
    """Every truth against the posterior of its image.

    Returns:
        The judgements, and for each truth the log-ratio of every model.
    """
    count = len(truths.images)
    with _judges(court, truths, min(workers, count)) as judged, progress_bar("posteriors", count) as advance:
        results = []
        for result in judged(range(count)):
            results.append(result)
            advance(len(results))
    return [judgement for judgement, _ in results], [values for _, values in results]


@contextmanager
def _judges(court: Court, truths: Truths, workers: int) -> Iterator[Callable[[range], Iterator[Verdict]]]:
    if workers == 1:
        judge = _Judge(court, truths)
        yield lambda rows: map(judge, rows)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_start, initargs=(court, truths)) as pool:
        yield lambda rows: pool.map(_judge_row, rows)


class _Judge:
    """The models of one process, and what they say of each observation."""

    def __init__(self, court: Court, truths: Truths) -> None:
        from bayesgrasp.ratio.checkpoint import load_model
        from bayesgrasp.workflows.load import trained_prior

        self.court, self.truths = court, truths
        self.models = [load_model(directory) for directory in court.models]
        self.prior = trained_prior(self.models[0].card)

    def __call__(self, row: int) -> Verdict:
        import torch

        from bayesgrasp.diagnostics.posterior_report import Observation, judge
        from bayesgrasp.seeding import Stream, generator, torch_generator

        image, truth = self.truths.images[row], self.truths.hands[row]
        ratios = [model.given_image(image) for model in self.models]
        tried = self.prior.sample(self.court.proposals, generator(self.court.seed, Stream.DIAGNOSED_PRIOR, row))

        def log_posterior(hands: Hands) -> Tensor:
            return ratios[0](hands) + self.prior.log_prob(hands)

        observation = Observation(truth, log_posterior, tried, self.prior.log_prob(tried))
        with torch.no_grad():
            values = [ratio(truth).item() for ratio in ratios]
        return judge(observation, DRAWS, torch_generator(self.court.seed, Stream.DIAGNOSED_RANK, row)), values


_judge: list[_Judge] = []


def _start(court: Court, truths: Truths) -> None:
    """A pool's worker keeps its models for all observations: the one place for process-wide state."""
    import torch

    torch.set_num_threads(1)
    _judge.append(_Judge(court, truths))


def _judge_row(row: int) -> Verdict:
    return _judge[0](row)
