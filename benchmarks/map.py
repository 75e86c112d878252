"""The search for the MAP against Pymanopt's conjugate gradient: objective and time on the same problems, in one run.

Problems are images of the analytic simulator, whose log-ratio is exact (`known/analytic.py`). Both start from
the same hands, the best of 1000 draws from the prior for each grasp type (paper, Algorithm 2); 20 steps at most.
Pymanopt gets the box of the prior as an infinite objective outside. Objectives are compared in float64.

    python benchmarks/map.py [--problems 100] [--starts 1] [--json FILE]
"""

import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pymanopt
import torch
import tyro
from pymanopt.manifolds import Euclidean, Product, SpecialOrthogonalGroup
from pymanopt.optimizers import ConjugateGradient

from bayesgrasp.files import write_json
from bayesgrasp.known.analytic import AnalyticGrasping
from bayesgrasp.posterior.ascent import AscentConfig, ascend, starting_points, with_every_type
from bayesgrasp.posterior.potential import Potential, posterior_potential
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.seeding import generator
from bayesgrasp.types import GraspType, Hands

STEPS = 20
MANIFOLD = Product([Euclidean(3), SpecialOrthogonalGroup(3)])


@dataclass(frozen=True)
class Result:
    """Best objective over the starts, and process CPU time, seconds."""

    objective: float
    seconds: float


def by_pymanopt(potential: Potential, starts: Hands) -> Result:
    """One run of Pymanopt's conjugate gradient per start; the best end."""
    started = time.process_time()
    optimizer = ConjugateGradient(max_iterations=STEPS, verbosity=0)
    ends = [optimizer.run(problem(potential, hand), initial_point=point(hand)) for hand in unbatched(starts)]
    seconds = time.process_time() - started
    hands = Hands(
        torch.from_numpy(np.stack([end.point[0] for end in ends])),
        torch.from_numpy(np.stack([end.point[1] for end in ends])),
        starts.grasp_type,
    )
    return Result(float(potential.value(hands).min()), seconds)


def problem(potential: Potential, hand: Hands) -> pymanopt.Problem:
    """The potential of one grasp type on R^3 x SO(3)."""

    @pymanopt.function.pytorch(MANIFOLD)  # type: ignore[untyped-decorator]
    def cost(position: torch.Tensor, rotation: torch.Tensor) -> torch.Tensor:
        hands = Hands(position, rotation, hand.grasp_type)
        value = -sum(term(hands) for term in potential.terms)
        return torch.where(potential.box.contains(position), value, torch.inf)

    return pymanopt.Problem(MANIFOLD, cost)


def point(hand: Hands) -> list[np.ndarray]:
    """A hand as Pymanopt wants it."""
    return [hand.position.numpy(), hand.rotation.numpy()]


def unbatched(hands: Hands) -> list[Hands]:
    """Hands one by one, float64."""
    return [hands.to(dtype=torch.float64)[k] for k in range(len(hands.grasp_type))]


def by_ascent(potential: Potential, starts: Hands, config: AscentConfig) -> Result:
    """All starts at once, in float32; the best end."""
    started = time.process_time()
    ends = ascend(potential, starts, config)
    seconds = time.process_time() - started
    return Result(float(potential.value(ends.hands.to(dtype=torch.float64)).min()), seconds)


def main(problems: int = 100, starts: int = 1, seed: int = 0, json: Path | None = None) -> None:
    """Compare both on the same problems.

    Args:
        problems: Number of images.
        starts: Starts per grasp type, for both.
        seed: Of images and starts.
        json: Where to write the numbers.
    """
    torch.set_num_threads(1)
    warnings.filterwarnings("ignore", category=RuntimeWarning, module="pymanopt")
    prior = GraspPrior()
    analytic = AnalyticGrasping(prior)
    images = analytic.sample_successes(problems, generator(seed, 0)).image
    ours, theirs = [], []
    for k, image in enumerate(images):

        def log_ratio(hands: Hands, image: torch.Tensor = image) -> torch.Tensor:
            return analytic.log_success_given_image(image, hands)

        potential = posterior_potential(log_ratio, prior)
        candidates = with_every_type(prior.sample(1000, generator(seed, 1, k)))
        start = starting_points(candidates, potential.value(candidates), starts)
        ours.append(by_ascent(potential, start, AscentConfig(starts_per_type=starts, steps=STEPS)))
        theirs.append(by_pymanopt(potential, start))
    report(ours, theirs, json)


def report(ours: list[Result], theirs: list[Result], json: Path | None) -> None:
    """Print, and write, the comparison."""
    difference = np.array([mine.objective - other.objective for mine, other in zip(ours, theirs, strict=True)])
    seconds = [float(np.sum([result.seconds for result in results])) / len(results) for results in (ours, theirs)]
    content = {
        "problems": len(ours),
        "types": len(GraspType),
        "better_by_1e-3": int((difference < -1e-3).sum()),
        "same_within_1e-3": int((np.abs(difference) <= 1e-3).sum()),
        "worse_by_1e-3": int((difference > 1e-3).sum()),
        "largest_loss_nats": float(difference.max()),
        "mean_gain_nats": float(-difference.mean()),
        "ours_ms": 1e3 * seconds[0],
        "pymanopt_ms": 1e3 * seconds[1],
        "ratio": seconds[1] / seconds[0],
    }
    for name, value in content.items():
        print(f"{name:20} {value:.4g}")
    if json is not None:
        write_json(json, content)


if __name__ == "__main__":
    tyro.cli(main)
