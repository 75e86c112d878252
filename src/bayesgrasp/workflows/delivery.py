"""What plans of a model deliver on objects that no training had met: ``bayesgrasp calibrate``.

One scene for each object: its image, the plan, the lift test of the best grasp, whatever that promises. Promises and
outcomes go into the model's card, where they calibrate its success probabilities and say which promises are enough for
a wanted confidence (`ratio.delivery`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.journal import Journal, SceneResult
from bayesgrasp.evaluation.runner import Benchmark, Contestants, run
from bayesgrasp.locks import sole_writer
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.planning.planner import PlannerConfig
from bayesgrasp.planning.selection import SelectionConfig
from bayesgrasp.ratio.card import promising_weights, read_card, write_card
from bayesgrasp.ratio.delivery import FEWEST, Delivery
from bayesgrasp.workflows.evaluate import ModelContestants
from bayesgrasp.workflows.load import success_probability

STRATEGY = "plan"


@dataclass(frozen=True)
class Uncalibrated:
    """Model and planner of a directory, as the model promises before any calibration, and never declining.

    Attributes:
        directory: Of the model.
    """

    directory: Path

    def load(self) -> Contestants:
        """Load them."""
        found = ModelContestants(self.directory).load()
        promise = success_probability(found.model)
        likelihood = replace(found.planner.likelihood, success_probability=promise, delivered=None)
        config = PlannerConfig(selection=SelectionConfig(least_success=0.0))
        return replace(found, planner=replace(found.planner, likelihood=likelihood, config=config))


@dataclass(frozen=True)
class DeliveryJob:
    """Plans to be tried.

    Attributes:
        model: Directory of the model.
        objects: Fresh objects, each of which has one scene.
        split: What they are called.
        seed: Of scenes and plans.

    Raises:
        CheckpointError: There is no such model.
        InvalidConfigurationError: Too few objects, or one that the model was trained with.
    """

    model: Path
    objects: tuple[ObjectAsset, ...]
    split: str
    seed: int = 0

    def __post_init__(self) -> None:
        known = set(read_card(self.model).get("objects", ()))
        if met := [asset.id for asset in self.objects if asset.id in known]:
            raise InvalidConfigurationError(
                f"{len(met)} of the objects were trained with ({', '.join(met[:3])}): what is promised for them says "
                "nothing of fresh ones; take others, as procedural:1000@77"
            )
        if len(self.objects) < FEWEST:
            raise InvalidConfigurationError(
                f"a calibration needs at least {FEWEST} objects, one plan each; got {len(self.objects)}"
            )

    def run(
        self,
        out: Path,
        workers: int = 1,
        *,
        resume: bool = False,
        progress: Callable[[SceneResult], None] | None = None,
    ) -> tuple[SceneResult, ...]:
        """Try the plans; arguments and errors as of `evaluate.Evaluation.run`."""
        benchmark = Benchmark(self.objects, Uncalibrated(self.model).load, (STRATEGY,), self.seed)
        with sole_writer(out):
            identity = benchmark.identity(read_card(self.model)) | {"purpose": "calibration"}
            return run(benchmark, len(self.objects), workers, Journal(out, identity, resume), progress)

    def write(self, results: Sequence[SceneResult]) -> Delivery:
        """Write what the plans delivered into the card of the model."""
        card = read_card(self.model)
        trials = [result.trials[STRATEGY] for result in results]
        said = [(trial.promised, trial.success) for trial in trials if trial.promised is not None]
        promised, success = (np.array(column) for column in zip(*said, strict=True)) if said else (np.empty(0),) * 2
        delivery = Delivery(promised, success.astype(bool), self.split, promising_weights(card))
        write_card(self.model, card | {"delivery": delivery.to_dict()})
        return delivery
