"""How well can one do without an image? The best fixed hand, found in the simulator, beside the maxima of r(S | h).

    python benchmarks/fixed_hands.py [--ycb-dir DIR] [--model DIR] [--scenes 1920] [--json results/fixed_hands.json]

A grid of 216 hands (three types, nine heights, four turns about the vertical straight down, three leans of 14 degrees
and one of 34) goes through successive halving on random scenes of the training objects. The three best, and what the
model holds for the maxima of p(S=1 | h) and of p(h | S=1), are then tried in the same scenes, which chose none of them.
"""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from jaxtyping import Bool

from bayesgrasp.diagnostics.intervals import paired_difference, wilson
from bayesgrasp.evaluation.baselines.fixed_hands import Blindfold, Round, halve
from bayesgrasp.files import write_json
from bayesgrasp.geometry import so3
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.posterior.ascent import AscentConfig, find_map
from bayesgrasp.posterior.potential import likelihood_potential, posterior_potential
from bayesgrasp.prior.power_spherical import downward_modes
from bayesgrasp.ratio.checkpoint import load_model
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Hands
from bayesgrasp.workflows.load import PAPER_MODEL, trained_prior

HEIGHTS = np.linspace(0.16, 0.28, 9)
QUARTER, LEAN, STEEP = math.pi / 2, 0.25, 0.6
ATTITUDES = (
    *((turn, 0.0, 0.0) for turn in (0.0, QUARTER / 2, QUARTER, 2 * QUARTER)),
    *((QUARTER, towards, LEAN) for towards in (0.0, QUARTER, 2 * QUARTER)),
    (QUARTER, 0.0, STEEP),
)
"""Turn about the vertical, azimuth of the horizontal axis of a lean, and its angle; radians."""
ARM = 0.17
"""A leaning palm goes back along its approach, so that what is so far ahead of it stays over the centre; metres."""
ROUNDS = (Round(24, 48), Round(48, 12), Round(192, 3))
FRESH = 1000
"""Number of the round that judges."""


def main(
    ycb_dir: Path | None = None,
    model: Path = PAPER_MODEL,
    scenes: int = 1920,
    seed: int = 100,
    json: Path | None = None,
) -> None:
    """Print success rates with their 95 % intervals.

    Args:
        ycb_dir: Scans; by default $BAYESGRASP_YCB_DIR.
        model: Whose maxima are judged.
        scenes: That they and the best fixed hands are judged in.
        seed: Of scenes and searches.
        json: Where to write the numbers.
    """
    torch.set_num_threads(1)
    objects = load_objects("train", ycb_dir)
    blindfold = Blindfold(LiftTest(objects).run, len(objects), seed)
    best = halve(grid(), blindfold, ROUNDS)
    found = maxima(model, seed)
    judged = blindfold.succeed(Hands.cat([best, *found.values()]), scenes, FRESH)
    names = [*(f"fixed {place + 1}" for place in range(len(best.grasp_type))), *found]
    hands = Hands.cat([best, *found.values()])
    rows = [row(name, hands[place], judged[place], judged[0]) for place, name in enumerate(names)]
    for one in rows:
        print(f"{one['name']:10s} {one['rate']:.3f} ({one['interval'][0]:.3f}-{one['interval'][1]:.3f})")
    if json is not None:
        content = {"scenes": scenes, "seed": seed, "hands": len(grid().grasp_type), "rows": rows}
        write_json(json, content)


def grid() -> Hands:
    """The candidates."""
    position, rotation, types = [], [], []
    for grasp_type, height, (turn, azimuth, lean) in product(range(3), HEIGHTS, ATTITUDES):
        turned = so3.exp(torch.tensor([0.0, 0.0, turn])).double() @ downward_modes()[0]
        axis = torch.tensor([math.cos(azimuth), math.sin(azimuth), 0.0]).double()
        leaning = so3.exp(lean * axis) @ turned
        aside = -ARM * leaning[:2, 0]
        position.append(torch.cat([aside, torch.tensor([height]).double()]))
        rotation.append(leaning)
        types.append(grasp_type)
    return Hands(torch.stack(position).float(), torch.stack(rotation).float(), torch.tensor(types))


def maxima(directory: Path, seed: int) -> dict[str, Hands]:
    """What the model's searches end at, one hand each."""
    model = load_model(directory)
    ratio, prior = model.given_success(), trained_prior(model.card)
    potentials = {"MLE": likelihood_potential(ratio, prior), "MAP": posterior_potential(ratio, prior)}
    rng = generator(seed, Stream.BENCHMARK_SEARCH)
    config = AscentConfig(starts_per_type=4)
    return {name: find_map(p, prior, rng, config=config).best[None] for name, p in potentials.items()}


def row(name: str, hand: Hands, won: Bool[np.ndarray, "n"], best: Bool[np.ndarray, "n"]) -> dict[str, Any]:
    """A hand with its rate, and by how much it succeeds more often than the best fixed one."""
    more, interval = paired_difference(won, best)
    return {
        "name": name,
        "position_m": [round(float(x), 4) for x in hand.position],
        "approach": [round(float(x), 3) for x in hand.rotation[:, 0]],
        "closing": [round(float(x), 3) for x in hand.rotation[:, 1]],
        "grasp_type": int(hand.grasp_type),
        "rate": float(won.mean()),
        "interval": wilson(int(won.sum()), len(won)),
        "more_than_best": {"difference": more, "interval": interval},
    }


if __name__ == "__main__":
    tyro.cli(main)
