"""``bayesgrasp diagnose``: is a trained posterior right?"""

from __future__ import annotations

import os
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from torch import Tensor

    from bayesgrasp.data.loader import GraspDataset, Split
    from bayesgrasp.diagnostics.reliability import Reliability
    from bayesgrasp.diagnostics.report import Report
    from bayesgrasp.ratio.model import GraspModel
    from bayesgrasp.types import Hands

DRAWS = 100
"""Posterior draws per observation, for ranks."""
RATE = 0.015
"""Successes per attempt that the first round of fresh simulations counts on."""
FRESH = 2**20
"""Added to the seed of fresh simulations."""


def diagnose(
    model: Path | None = None,
    data: Path | None = None,
    fresh: int | None = None,
    truths: int = 500,
    proposals: int = 10_000,
    ensemble: tuple[Path, ...] = (),
    json: Path | None = None,
    out: Path | None = None,
    seed: int = 0,
    split: str = "train",
    ycb_dir: Path | None = None,
    workers: int = os.cpu_count() or 1,
) -> None:
    """Judge a trained posterior by simulated successes that it has not seen.

    Expected coverage of highest-density regions, simulation-based calibration, TARP, reliability of the success
    probability, and the disagreement of an ensemble. Takes the test scenes of --data, or simulates --fresh successes.

    Args:
        model: Directory of a model; by default the one that comes with the package.
        data: Directory of a data set; its test split is used.
        fresh: Simulate at least this many new successes instead.
        truths: Pairs of a successful hand and an image, at most.
        proposals: Draws from the prior behind every posterior.
        ensemble: Further models, trained with other seeds.
        json: Where the numbers go.
        out: Where the figures go.
        seed: Of all random numbers.
        split: With --fresh, the objects: train, unseen, ...
        ycb_dir: With --fresh, directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        workers: With --fresh, processes.
    """
    import tempfile

    from bayesgrasp.cli.loading import DEFAULT_MODEL
    from bayesgrasp.data.loader import GraspDataset
    from bayesgrasp.errors import InvalidConfigurationError
    from bayesgrasp.ratio.checkpoint import load_model

    if (data is None) == (fresh is None):
        raise InvalidConfigurationError("give either --data DIR or --fresh N")
    models = [load_model(path) for path in (DEFAULT_MODEL if model is None else model, *ensemble)]
    with tempfile.TemporaryDirectory() as scratch:
        directory = Path(scratch) / "fresh" if data is None else data
        if fresh is not None:
            _simulate(directory, fresh, seed, split, ycb_dir, workers)
        dataset = GraspDataset(directory)
        result = _judge(models, dataset, "test" if fresh is None else "all", truths, proposals, seed)
    content = result.to_dict()
    if json is not None:
        json.write_text(dumps(content, indent=1) + "\n", encoding="utf-8")
    figures = () if out is None else result.draw(out)
    _show(content, figures)


def _simulate(out: Path, successes: int, seed: int, split: str, ycb_dir: Path | None, workers: int) -> None:
    """A data set with at least so many successes, in as many rounds as it takes."""
    from bayesgrasp.cli.generate import generate
    from bayesgrasp.data.store import Store
    from bayesgrasp.errors import InvalidConfigurationError

    if successes < 1:
        raise InvalidConfigurationError(f"--fresh needs at least one success, got {successes}")
    attempts, found = round(successes / RATE) + 1, 0
    while found < successes:
        # Its own seed, so that no training set of the same seed has the same draws.
        generate(attempts, out, seed=FRESH + seed, workers=workers, resume=True, split=split, ycb_dir=ycb_dir)
        found = int(Store(out).manifest().totals["outcomes"]["success"])
        attempts = 2 * attempts


def _judge(
    models: list[GraspModel], dataset: GraspDataset, split: Split, truths: int, proposals: int, seed: int
) -> Report:
    import numpy as np
    import torch

    from bayesgrasp.cli.loading import trained_prior
    from bayesgrasp.diagnostics.report import Observation, judge, report
    from bayesgrasp.geometry.grasp_space import GraspSpace
    from bayesgrasp.seeding import generator, torch_generator
    from bayesgrasp.types import Hands

    prior = trained_prior(models[0].card)
    loader = dataset.scenes(split, batch_size=1, shuffle=False)
    rng, drawing = generator(seed, 0), torch_generator(seed, 1)
    truth, judged, spread = [], [], []
    for row, column in _successes(dataset, split, truths, rng):
        batch = loader.batch(np.array([row]))
        ratio, tried = models[0].given_image(batch.images[0]), prior.sample(proposals, rng)
        truth.append(batch.hands[0, column])
        posterior = _posterior(ratio, prior.log_prob)
        judged.append(judge(Observation(truth[-1], posterior, tried, prior.log_prob(tried)), DRAWS, drawing))
        spread.append([model.given_image(batch.images[0])(truth[-1]).item() for model in models])
    fields = ("position", "rotation", "grasp_type")
    stacked = Hands(*(torch.stack([getattr(h, f) for h in truth]) for f in fields))
    references = prior.sample(len(truth), rng)
    reliable = _reliability(models[0], dataset, split)
    return report(stacked, judged, references, GraspSpace().distance, rng, reliable, _spread(spread))


def _posterior(ratio: Callable[[Hands], Tensor], log_prior: Callable[[Hands], Tensor]) -> Callable[[Hands], Tensor]:
    return lambda hands: ratio(hands) + log_prior(hands)


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


def _reliability(model: GraspModel, dataset: GraspDataset, split: Split) -> Reliability:
    """Of p(S=1 | i, h) at hands from the prior: the hands of the scenes, weighted back."""
    import numpy as np
    import torch

    from bayesgrasp.cli.loading import success_probability
    from bayesgrasp.diagnostics.reliability import reliability

    probability_of, parts = success_probability(model), []
    for batch in dataset.scenes(split, batch_size=16, shuffle=False)(0):
        with torch.no_grad():
            ratios = [model.given_image(image)(batch.hands[i]) for i, image in enumerate(batch.images)]
        probability = probability_of(torch.stack(ratios))
        parts.append(torch.stack([probability, batch.success, batch.weight]).flatten(1))
    probability, success, weight = torch.cat(parts, 1).double().numpy()
    return reliability(np.clip(probability, 0, 1), success, weight, bins=20)


def _spread(values: list[list[float]]) -> np.ndarray | None:
    """Disagreement of the models at the truths; None for a single model."""
    import numpy as np

    from bayesgrasp.diagnostics.reliability import ensemble_spread

    members = np.array(values).T
    return ensemble_spread(members) if len(members) > 1 else None


def _show(content: dict[str, Any], figures: tuple[Path, ...]) -> None:
    coverage, tarp, reliable = (content[name] for name in ("expected_coverage", "tarp", "reliability"))
    side = "too wide" if coverage["mean_signed_error"] > 0 else "too narrow"
    print(f"expected coverage: largest error {coverage['max_error']:.3f} over {coverage['count']} successes ({side})")
    for name, ranks in content["sbc"].items():
        print(f"SBC {name}: p = {ranks['p_value']:.3g}, spread {ranks['spread']:.2f}, shift {ranks['shift']:+.3f}")
    print(f"TARP: p = {tarp['p_value']:.3g}, spread {tarp['spread']:.2f}")
    print(f"p(S=1 | i, h): ECE {reliable['ece']:.4f}, Brier {reliable['brier']:.4f}, AUC {reliable['auc']:.4f}")
    if content["ensemble_spread"] is not None:
        print(f"ensemble spread: median {content['ensemble_spread']['quantile_50']:.2f} nats")
    print(f"importance weights: effective sample size {content['effective_sample_size']:.0f} (median)")
    for path in figures:
        print(path)
