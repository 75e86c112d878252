"""How close does the planner's search come to the maximum, and at what cost? Against brute force, scene by scene.

    python benchmarks/search.py [--scenes 240] [--ycb-dir DIR] [--cache DIR] [--json results/search.json]

Brute force is the search of `posterior.ascent` from 200 starts for 60 steps, once for the maximum of p(h | S=1, i)
(MAP) and once for that of p(S=1 | i, h) inside the prior's box (MLE). A gap is by how many nats the best hand of the
planner's search is below it; a negative one is where the search was the better of the two. Times are CPU times of this
process, the draws from the prior included. Brute force does not change with the search, so its values can be kept.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from torch import Tensor

from bayesgrasp.evaluation.scenes import SceneMaker
from bayesgrasp.files import read_json, write_json
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.planning.search import SearchConfig, search
from bayesgrasp.posterior.ascent import AscentConfig, find_map
from bayesgrasp.posterior.importance import estimate_evidence, weigh
from bayesgrasp.posterior.posterior import Posterior
from bayesgrasp.posterior.potential import LogDensity, Potential, Prior, likelihood_potential, posterior_potential
from bayesgrasp.ratio.checkpoint import load_model
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Hands
from bayesgrasp.workflows.load import DEFAULT_MODEL, trained_prior

BRUTE = AscentConfig(starts_per_type=67, steps=60)
"""200 starts, rounded up to a whole number for each grasp type."""
CLOSE = (0.05, 0.1)
"""Nats below the maximum within which a search is said to have found it."""
KINDS = {"MAP": posterior_potential, "MLE": likelihood_potential}


@dataclass(frozen=True)
class Found:
    """The best of a search in one scene.

    Attributes:
        value: Negative potential, nats, by kind.
        seconds: CPU time.
    """

    value: dict[str, float]
    seconds: float


def by_planner(log_ratio: LogDensity, prior: Prior, config: SearchConfig, seed: int, number: int) -> Found:
    """The planner's search, with its draws; both kinds at once, as it finds them."""
    rng, started = generator(seed, Stream.PLAN, number), time.process_time()
    drawn = weigh(log_ratio, prior, config.num_draws, rng)
    posterior = Posterior(log_ratio, prior, estimate_evidence(drawn.log_ratio), torch.exp)
    candidates, _ = search(posterior, drawn, config, None, rng)
    seconds = time.process_time() - started
    assert candidates is not None
    return Found({kind: best(make(log_ratio, prior), candidates.hands) for kind, make in KINDS.items()}, seconds)


def by_brute_force(log_ratio: LogDensity, prior: Prior, seed: int, number: int) -> Found:
    """Both kinds, one after the other."""
    started, value = time.process_time(), {}
    for kind, make in KINDS.items():
        rng = generator(seed, Stream.BENCHMARK_SEARCH, number)
        value[kind] = -float(find_map(make(log_ratio, prior), prior, rng, 2000, BRUTE).value.min())
    return Found(value, time.process_time() - started)


def best(potential: Potential, hands: Hands) -> float:
    """The largest negative potential among hands."""
    return -float(potential.value(hands).min())


def kept(path: Path | None) -> Found | None:
    """What brute force found earlier."""
    return Found(**read_json(path, 10_000)) if path is not None and path.exists() else None


def summarize(ours: list[Found], brute: list[Found]) -> dict[str, Any]:
    """Gaps and times."""
    content: dict[str, Any] = {
        "scenes": len(ours),
        "search_ms": 1e3 * float(np.mean([found.seconds for found in ours])),
        "brute_ms": 1e3 * float(np.mean([found.seconds for found in brute])),
    }
    for kind in KINDS:
        gap = np.array([most.value[kind] - found.value[kind] for found, most in zip(ours, brute, strict=True)])
        content[kind] = {f"within_{close}": float((gap <= close).mean()) for close in CLOSE}
        content[kind] |= {"better_by_0.05": float((gap < -CLOSE[0]).mean()), "mean_gap": float(gap.mean())}
        content[kind] |= {"mean_loss": float(gap.clip(0).mean()), "largest_loss": float(gap.max())}
    return content


def describe(content: dict[str, Any]) -> str:
    """The summary as lines of text."""
    lines = [
        f"{content['scenes']} scenes; search {content['search_ms']:.1f} ms, brute {content['brute_ms']:.0f} ms CPU"
    ]
    for kind in KINDS:
        lines.append(f"{kind}: " + ", ".join(f"{name} {value:.4g}" for name, value in content[kind].items()))
    return "\n".join(lines)


def main(
    scenes: int = 240,
    seed: int = 1001,
    split: str = "train",
    ycb_dir: Path | None = None,
    model: Path = DEFAULT_MODEL,
    cache: Path | None = None,
    json: Path | None = None,
) -> None:
    """Print gaps and times.

    Args:
        scenes: How many; objects take turns.
        seed: Of scenes and searches; not one that a published table was made with.
        split: Objects.
        ycb_dir: Scans; by default $BAYESGRASP_YCB_DIR.
        model: Whose posteriors are searched.
        cache: Directory where brute force's values are kept; one for each model, seed and split.
        json: Where to write the numbers.
    """
    torch.set_num_threads(1)
    trained = load_model(model)
    prior, maker = trained_prior(trained.card), SceneMaker(load_objects(split, ycb_dir), seed)
    ours, brute = [], []
    for number in range(scenes):
        image: Tensor = torch.from_numpy(maker.make(number).image)[None]
        log_ratio = trained.given_image(image)
        ours.append(by_planner(log_ratio, prior, SearchConfig(), seed, number))
        path = None if cache is None else cache / f"{number}.json"
        most = kept(path)
        if most is None:
            most = by_brute_force(log_ratio, prior, seed, number)
            if path is not None:
                write_json(path, asdict(most))
        brute.append(most)
    content = {"seed": seed, "split": split, "search": asdict(SearchConfig())} | summarize(ours, brute)
    print(describe(content))
    if json is not None:
        write_json(json, content)


if __name__ == "__main__":
    tyro.cli(main)
