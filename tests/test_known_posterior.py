"""The whole chain on a problem whose posterior is known: simulate, train, infer, compare with exact draws.

Both routes are trained on the analytic problem (`known/analytic.py`): the two networks of the paper by Algorithm
1, and p(S=1 | i, h) on successes and failures. Their product with the prior is compared with the closed form: by the
expected coverage of highest-density regions over many images, and for the paper's route by a classifier two-sample test
for single ones.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest
import torch
from c2st import c2st
from torch import Tensor, nn

from bayesgrasp.data.schema import Batch
from bayesgrasp.diagnostics.coverage import expected_coverage, hpd_mass
from bayesgrasp.known.analytic import AnalyticConfig, AnalyticGrasping
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.ratio.estimators import ImageConfig, SuccessRatioConfig
from bayesgrasp.ratio.kinds import build
from bayesgrasp.ratio.layers import ConvConfig
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.seeding import generator, torch_generator
from bayesgrasp.training.objectives import ImageObjective, Objective, SuccessObjective, SuccessRatioObjective
from bayesgrasp.training.sources import Sources
from bayesgrasp.training.train_estimator import TrainConfig, train_estimator
from bayesgrasp.types import Hands

Ratio = Callable[[Hands], Tensor]
PRIOR = GraspPrior()
PROBLEM = AnalyticGrasping(PRIOR, AnalyticConfig(grid=(3, 3, 4)))
IMAGES, PROPOSALS, TRUTHS = 200, 3000, 20


@dataclass(frozen=True)
class Simulated:
    """Fresh simulations at every step, addressed by epoch and step."""

    make: Callable[[np.random.Generator], Batch]
    steps: int
    seed: int

    def __len__(self) -> int:
        return self.steps

    def batches(self, epoch: int) -> Iterator[Batch]:
        return (self.make(generator(self.seed, epoch, step)) for step in range(self.steps))


def batch(hands: Hands, success: Tensor, weight: Tensor, images: Tensor) -> Batch:
    """Tuples with as many hands for each image as there are."""
    scenes = len(images)
    position, rotation, types, s, w = (
        x.unflatten(0, (scenes, -1)) for x in (hands.position, hands.rotation, hands.grasp_type, success, weight)
    )
    ones, zeros = torch.ones(scenes), torch.zeros(scenes, 3)
    index = torch.zeros(scenes, dtype=torch.int64)
    return Batch(Hands(position, rotation, types), s, w, w, images, index, ones, zeros, torch.ones_like(w), s)


def successful_hands(n: int, rng: np.random.Generator) -> Hands:
    """From p(h | S=1), without the images that `sample_successes` draws as well."""
    index = rng.choice(len(PROBLEM.poses), size=n, p=torch.softmax(PROBLEM.grasp.log_evidence, -1).numpy())
    return PROBLEM.grasp.sample_hands(index, rng)


def successes(rng: np.random.Generator) -> Batch:
    """(i, h) from p(i, h | S=1)."""
    draws = PROBLEM.sample_successes(256, rng)
    return batch(draws.hands, torch.ones(256), torch.ones(256), draws.image)


def attempts(rng: np.random.Generator) -> Batch:
    """(S, h) from p(S, h): successes are drawn apart and weighted back, since they are rare."""
    many, few = 2048, 512
    prior, successful = PRIOR.sample(many, rng), successful_hands(few, rng)
    weight = torch.cat([1 - PROBLEM.log_success(prior).exp(), torch.full((few,), PROBLEM.success_rate * many / few)])
    success = torch.cat([torch.zeros(many), torch.ones(few)])
    return batch(Hands.cat([prior, successful]), success, weight, torch.zeros(1, 1, 1, 1))


def tries(rng: np.random.Generator) -> Batch:
    """(S, i, h) with hands of one law for all images: S given (i, h) is right under any such law."""
    scenes, each = 64, 32
    index = rng.integers(len(PROBLEM.poses), size=scenes)
    some, near = PRIOR.sample(scenes * each // 4, rng), successful_hands(scenes * each * 3 // 4, rng)
    hands = Hands.cat([some, near])[torch.from_numpy(rng.permutation(scenes * each))]
    chance = PROBLEM.grasp.log_success(hands).exp()[
        torch.arange(scenes * each), torch.from_numpy(np.repeat(index, each))
    ]
    success = torch.from_numpy(rng.random(scenes * each)) < chance
    return batch(hands, success.float(), torch.ones(scenes * each), PROBLEM.sample_image(index, rng))


def fitted(kind: str, config: object, objective: Objective, make: Callable, steps: int) -> nn.Module:
    schedule = TrainConfig(epochs=1, learning_rate=3e-3, average=0.995, weight_decay=1e-4, bf16=False)
    sources = Sources(Simulated(make, steps, seed=1), Simulated(make, 2, seed=2))
    result = train_estimator(lambda: build(kind, config), objective, sources, schedule)
    return result.estimator.requires_grad_(False)


@pytest.fixture(scope="module")
def models() -> dict[str, GraspModel]:
    """By route."""
    config = ImageConfig(encoder=ConvConfig((20, 32), (16, 32, 32), 64), widths=(128, 128), activation="relu")
    image = fitted("image", config, ImageObjective(hands=1, shifts=6), successes, steps=1200)
    success_ratio = fitted(
        "success_ratio", SuccessRatioConfig(activation="relu"), SuccessRatioObjective(), attempts, steps=700
    )
    success = fitted("global", config, SuccessObjective(), tries, steps=800)
    return {
        "factorised": GraspModel({"image": image, "success_ratio": success_ratio}, {}),
        "success": GraspModel({"success": success}, {}),
    }


@pytest.fixture(scope="module")
def images() -> Tensor:
    return PROBLEM.sample_successes(IMAGES, generator(9)).image


def exact(image: Tensor) -> Ratio:
    return lambda hands: PROBLEM.log_success_given_image(image, hands)


def coverage_error(ratio_of: Callable[[Tensor], Ratio], images: Tensor, power: float = 1.0) -> tuple[float, float]:
    """Largest and mean signed error of the coverage, for the ratio raised to a power."""
    rng = generator(10)
    proposals = PROBLEM.sample_successes(PROPOSALS, rng).hands
    log_proposal, log_prior = PROBLEM.log_success(proposals), PRIOR.log_prob(proposals)
    masses = []
    for image in images:
        ratio, truths = ratio_of(image), PROBLEM.posterior(image).sample(TRUTHS, rng)
        values = power * ratio(proposals)
        density = power * ratio(truths) + PRIOR.log_prob(truths)
        weights = (values - log_proposal).exp().double().numpy()
        draws = (values + log_prior).double().numpy()
        shape = (TRUTHS, PROPOSALS)
        masses.append(hpd_mass(density.double().numpy(), *(np.broadcast_to(x, shape) for x in (draws, weights))))
    result = expected_coverage(np.concatenate(masses))
    return result.max_error, result.mean_signed_error


def accuracy(ratio: Ratio, image: Tensor, rng: np.random.Generator, drawing: torch.Generator) -> float:
    """How well a classifier tells draws by importance resampling from exact ones."""
    proposals = PROBLEM.sample_successes(15_000, rng).hands
    weight = (ratio(proposals) - PROBLEM.log_success(proposals)).exp()
    chosen = torch.multinomial(weight, 800, replacement=False, generator=drawing)
    return c2st(PROBLEM.posterior(image).sample(800, rng), proposals[chosen], drawing)


@pytest.mark.parametrize("route", ["factorised", "success"])
def test_coverage_of_the_trained_posterior(models: dict[str, GraspModel], images: Tensor, route: str) -> None:
    assert coverage_error(models[route].given_image, images)[0] < 0.03


def test_the_coverage_test_can_fail(images: Tensor) -> None:
    """The exact posterior passes it; the exact one sharpened or flattened fails it on the right side."""
    assert coverage_error(exact, images[:80])[0] < 0.03
    sharp, flat = (coverage_error(exact, images[:80], power) for power in (2.0, 0.5))
    assert sharp[0] > 0.05
    assert sharp[1] < 0
    assert flat[0] > 0.05
    assert flat[1] > 0


def test_two_sample_test_against_exact_draws(models: dict[str, GraspModel], images: Tensor) -> None:
    """For the paper's route; the other one needs longer training than a test has to come as close."""
    rng, drawing = generator(11), torch_generator(12)
    scores = [accuracy(models["factorised"].given_image(image), image, rng, drawing) for image in images[:12]]
    assert abs(float(np.mean(scores)) - 0.5) < 0.05


def test_the_two_sample_test_can_fail(images: Tensor) -> None:
    """Without the image, p(h | S=1) is another distribution; and so is the posterior of another image."""
    rng, drawing = generator(13), torch_generator(14)
    assert accuracy(PROBLEM.log_success, images[0], rng, drawing) > 0.6
    other = next(image for image in images[1:] if _far(images[0], image))
    assert accuracy(exact(other), images[0], rng, drawing) > 0.6


def _far(first: Tensor, second: Tensor) -> bool:
    poses = [PROBLEM.poses[int(PROBLEM.log_pose_given_image(image).argmax())] for image in (first, second)]
    return bool(np.linalg.norm(poses[0][:2] - poses[1][:2]) > 0.06)


def test_ratios_average_to_one(models: dict[str, GraspModel]) -> None:
    """E_{p(h)} r(S=1 | h) = 1 and E_{p(i | S=1) p(h | S=1)} r(i | S=1, h) = 1."""
    rng, model = generator(15), models["factorised"]
    with torch.no_grad():
        success_ratio = model.given_success()(PRIOR.sample(20_000, rng)).exp().mean()
        draws = PROBLEM.sample_successes(300, rng)
        hands = PROBLEM.sample_successes(300, rng).hands
        image = model.estimators["image"]
        rows = Hands(*(x.expand(300, *x.shape) for x in (hands.position, hands.rotation, hands.grasp_type)))
        pairs = image(image.encode(draws.image), rows).exp().mean()
    assert float(success_ratio) == pytest.approx(1.0, abs=0.1)
    assert float(pairs) == pytest.approx(1.0, abs=0.1)
