"""``bayesgrasp diagnose``: is a trained posterior right?"""

from __future__ import annotations

import os
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np

    from bayesgrasp.cli.truths import Tried, Truths
    from bayesgrasp.diagnostics.reliability import Reliability
    from bayesgrasp.ratio.model import GraspModel


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
    probability, and the disagreement of an ensemble. Takes the test scenes of --data, or simulates --fresh successes:
    hands from the prior that succeed, each with an image of its own scene.

    Args:
        model: Directory of a model; by default the one that comes with the package.
        data: Directory of a data set; its test split is used.
        fresh: Simulate this many new successes from the prior instead.
        truths: With --data, pairs of a successful hand and an image, at most.
        proposals: Draws from the prior behind every posterior.
        ensemble: Further models, trained with other seeds.
        json: Where the numbers go.
        out: Where the figures go.
        seed: Of all random numbers.
        split: With --fresh, the objects: train, unseen, ...
        ycb_dir: With --fresh, directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        workers: Processes.
    """
    from bayesgrasp.cli.judging import Court, judge_all
    from bayesgrasp.diagnostics.posterior_report import report
    from bayesgrasp.errors import InvalidConfigurationError
    from bayesgrasp.geometry.grasp_space import GraspSpace
    from bayesgrasp.ratio.checkpoint import load_model
    from bayesgrasp.seeding import Stream, generator
    from bayesgrasp.workflows.load import DEFAULT_MODEL, trained_prior

    if (data is None) == (fresh is None):
        raise InvalidConfigurationError("give either --data DIR or --fresh N")
    court = Court((DEFAULT_MODEL if model is None else model, *ensemble), proposals, seed)
    first = load_model(court.models[0])
    found, tried = _evidence(data, fresh, truths, seed, split, ycb_dir, workers)
    judged, values = judge_all(court, found, workers)
    reliable = _reliability(first, tried)
    rng = generator(seed, Stream.REFERENCE)
    references = trained_prior(first.card).sample(len(judged), rng)
    result = report(found.hands, judged, references, GraspSpace().distance, rng, reliable, _spread(values))
    content = result.to_dict()
    if json is not None:
        json.write_text(dumps(content, indent=1) + "\n", encoding="utf-8")
    figures = () if out is None else result.draw(out)
    _show(content, figures)


def _evidence(
    data: Path | None,
    fresh: int | None,
    truths: int,
    seed: int,
    split: str,
    ycb_dir: Path | None,
    workers: int,
) -> tuple[Truths, Iterator[Tried]]:
    from bayesgrasp.cli import truths as source
    from bayesgrasp.data.loader import GraspDataset
    from bayesgrasp.seeding import Stream, generator

    if data is not None:
        return source.stored(GraspDataset(data), "test", truths, generator(seed, Stream.DIAGNOSED_PAIR))
    return source.fresh(split, ycb_dir, fresh or 0, seed, workers)


def _reliability(model: GraspModel, tried: Iterator[Tried]) -> Reliability:
    """Of p(S=1 | i, h) at hands from the prior."""
    import numpy as np
    import torch

    from bayesgrasp.diagnostics.reliability import reliability
    from bayesgrasp.workflows.load import success_probability

    probability_of, parts = success_probability(model), []
    for some in tried:
        with torch.no_grad():
            ratios = [model.given_image(image)(some.hands[i]) for i, image in enumerate(some.images)]
        parts.append(torch.stack([probability_of(torch.stack(ratios)), some.success, some.weight]).flatten(1))
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
