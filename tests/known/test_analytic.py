"""The analytic problem against its own simulations: ratios, calibration, normalisers, exact draws."""

import math

import numpy as np
import pytest
import torch
from scipy import stats

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.known.analytic import AnalyticConfig, AnalyticGrasping
from bayesgrasp.known.bar_grasp import BarGraspConfig
from bayesgrasp.known.bar_image import BarImage
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.types import Hands

PRIOR = GraspPrior()


@pytest.fixture(scope="module")
def problem() -> AnalyticGrasping:
    """Few poses, wide tolerances: successes are common enough for simulations to check everything."""
    grasp = BarGraspConfig(deviation=(0.06, 0.06, 0.08), sharpness=4.0)
    return AnalyticGrasping(
        PRIOR, AnalyticConfig(grid=(3, 3, 4), grasp=grasp, image=BarImage(size=(10, 16), pixel=0.02))
    )


def features(hands: Hands) -> dict[str, np.ndarray]:
    """Numbers that describe a hand: place, approach, the closing direction modulo its sign, type."""
    r = hands.rotation
    closing = torch.atan2(r[:, 1, 1], r[:, 0, 1])
    return {
        "x": hands.position[:, 0].numpy(),
        "y": hands.position[:, 1].numpy(),
        "z": hands.position[:, 2].numpy(),
        "approach x": r[:, 0, 0].numpy(),
        "approach z": r[:, 2, 0].numpy(),
        "closing": (2 * closing).cos().numpy(),
        "closing with place": ((2 * closing).sin() * hands.position[:, 0]).numpy(),
        "type": hands.grasp_type.numpy().astype(np.float32),
    }


def mean_is(values: torch.Tensor, expected: float, standard_error: float) -> None:
    """Within four standard errors, which must themselves be small enough for the check to mean something."""
    error = float(values.std()) / math.sqrt(len(values))
    assert error < standard_error
    assert abs(float(values.mean()) - expected) < 4 * error


def test_evidence_of_every_pose_agrees_with_the_prior(problem: AnalyticGrasping) -> None:
    success = problem.grasp.log_success(PRIOR.sample(60_000, np.random.default_rng(0))).exp()
    error = success.std(0) / math.sqrt(len(success))
    expected = problem.grasp.log_evidence.exp()
    assert ((success.mean(0) - expected).abs() < 5 * error).all()
    assert (error / expected).max() < 0.02
    assert (expected.max() / expected.min()) > 1.02  # poses differ, so that Z_o is no formality


def test_evidence_knows_that_the_prior_favours_some_yaws() -> None:
    sharp = BarGraspConfig(deviation=(1.0, 1.0, 1.0), sharpness=40.0)
    problem = AnalyticGrasping(PRIOR, AnalyticConfig(grid=(1, 1, 4), grasp=sharp))
    success = problem.grasp.log_success(PRIOR.sample(60_000, np.random.default_rng(14))).exp()
    expected, error = problem.grasp.log_evidence.exp(), success.std(0) / math.sqrt(len(success))
    assert ((success.mean(0) - expected).abs() < 4 * error).all()
    # Bars along a quarter turn suit a mode of the prior, those in between do not.
    torch.testing.assert_close(expected[0], expected[2])
    assert expected[0] > expected[1] + 10 * error[1]


def test_success_probabilities_are_probabilities_and_reach_their_bound(problem: AnalyticGrasping) -> None:
    assert problem.grasp.log_success(PRIOR.sample(5000, np.random.default_rng(1))).max() <= 0
    pose = problem.poses[5]
    down = torch.tensor([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]], dtype=torch.float64)
    rotation = so3.exp(torch.tensor([0.0, 0.0, pose[2]], dtype=torch.float64)) @ down
    heights = problem.config.grasp.height
    position = torch.tensor([[pose[0], pose[1], h] for h in heights], dtype=torch.float64)
    best = Hands(position, rotation.expand(3, 3, 3), torch.arange(3))
    # The hand closes across the bar: its y axis is perpendicular to the bar's long axis.
    assert abs(float(rotation[0, 1] * np.cos(pose[2]) + rotation[1, 1] * np.sin(pose[2]))) < 1e-12
    expected = torch.tensor(problem.config.grasp.weight, dtype=torch.float64)
    torch.testing.assert_close(problem.grasp.log_success(best)[:, 5].exp(), expected)


def test_ratios_average_to_one(problem: AnalyticGrasping) -> None:
    rng = np.random.default_rng(2)
    mean_is(problem.log_ratio_success(PRIOR.sample(60_000, rng)).exp(), 1.0, 0.02)
    images = problem.sample_successes(20_000, rng).image
    hands = problem.sample_successes(20_000, rng).hands
    mean_is(problem.log_ratio_image(images, hands).exp(), 1.0, 0.02)
    # Under the joint the image tells something: the mutual information is positive.
    together = problem.sample_successes(5000, rng)
    assert problem.log_ratio_image(together.image, together.hands).mean() > 0.1


def test_simulated_successes_are_calibrated(problem: AnalyticGrasping) -> None:
    """The share of S = 1 in bins of p(S=1 | i, h), and of p(S=1 | h)."""
    draws = problem.sample_joint(60_000, np.random.default_rng(3))
    success = draws.success.numpy()
    assert abs(success.mean() - problem.success_rate) < 4 * math.sqrt(problem.success_rate / len(success))
    for predicted in (problem.log_success_given_image(draws.image, draws.hands), problem.log_success(draws.hands)):
        p = predicted.exp().double().numpy()
        order = np.argsort(p)
        for part in np.array_split(order[20_000:], 8):
            expected, variance = p[part].sum(), (p[part] * (1 - p[part])).sum()
            assert abs(success[part].sum() - expected) < 4 * math.sqrt(variance) + 1


def test_constructed_successes_are_those_of_the_simulator(problem: AnalyticGrasping) -> None:
    rng = np.random.default_rng(4)
    joint = problem.sample_joint(100_000, rng)
    kept = joint.success
    made = problem.sample_successes(int(kept.sum()), rng)
    assert kept.sum() > 1000
    simulated, constructed = features(joint.hands[kept]), features(made.hands)
    for name, values in simulated.items():
        assert stats.ks_2samp(values, constructed[name]).pvalue > 1e-4, name
    counts = [np.bincount(i, minlength=len(problem.poses)) for i in (joint.pose_index[kept.numpy()], made.pose_index)]
    assert stats.chi2_contingency(np.stack(counts)).pvalue > 1e-4


def test_pose_given_image_is_calibrated(problem: AnalyticGrasping) -> None:
    rng = np.random.default_rng(5)
    index = rng.integers(len(problem.poses), size=5000)
    probability = problem.log_pose_given_image(problem.sample_image(index, rng)).exp()
    torch.testing.assert_close(probability.sum(-1), torch.ones(5000, dtype=torch.float64))
    assert 0.15 < float(probability.max(-1).values.mean()) < 0.95  # neither known nor unknown
    hit = torch.nn.functional.one_hot(torch.from_numpy(index), len(problem.poses))
    for low, high in [(0.001, 0.05), (0.05, 0.2), (0.2, 0.6), (0.6, 1.0)]:
        inside = (probability > low) & (probability <= high)
        expected, variance = probability[inside].sum(), (probability * (1 - probability))[inside].sum()
        assert abs(float(hit[inside].sum() - expected)) < 4 * math.sqrt(float(variance)) + 1


def test_posterior_is_prior_times_ratios_and_integrates_to_one(problem: AnalyticGrasping) -> None:
    rng = np.random.default_rng(6)
    hands = PRIOR.sample(60_000, rng)
    for image in problem.sample_successes(3, rng).image:
        log_prob = problem.posterior(image).log_prob(hands)
        ratios = problem.log_ratio_image(image[None], hands) + problem.log_ratio_success(hands)
        torch.testing.assert_close(log_prob, PRIOR.log_prob(hands) + ratios, rtol=0, atol=1e-4)
        mean_is((log_prob - PRIOR.log_prob(hands)).exp(), 1.0, 0.03)


def test_posterior_draws_have_the_posterior_density(problem: AnalyticGrasping) -> None:
    """Against the prior's draws weighted by the density: means of every feature."""
    rng = np.random.default_rng(7)
    posterior = problem.posterior(problem.sample_successes(1, rng).image[0])
    draws, reference = posterior.sample(20_000, rng), PRIOR.sample(100_000, rng)
    assert PRIOR.in_support(draws).all()
    weight = torch.softmax(posterior.log_prob(reference) - PRIOR.log_prob(reference), 0).double().numpy()
    effective = 1 / np.square(weight).sum()
    assert effective > 500
    weighted = features(reference)
    for name, values in features(draws).items():
        mean = (weight * weighted[name]).sum()
        error = values.std() * math.sqrt(1 / effective + 1 / len(values))
        assert abs(values.mean() - mean) < 4.5 * error, name


def test_ranks_of_the_truth_among_posterior_draws_are_uniform(problem: AnalyticGrasping) -> None:
    """Simulation-based calibration, with the density itself as one of the statistics (its coverage)."""
    rng, n, draws_each = np.random.default_rng(8), 600, 49
    truth = problem.sample_successes(n, rng)
    ranks: dict[str, list[int]] = {}
    for k in range(n):
        posterior = problem.posterior(truth.image[k])
        both = Hands.cat([truth.hands[k : k + 1], posterior.sample(draws_each, rng)])
        statistics = {**features(both), "density": posterior.log_prob(both).numpy()}
        for name, values in statistics.items():
            below = values + 1e-9 * rng.random(len(values))  # breaks the ties of the type
            ranks.setdefault(name, []).append(int((below[1:] < below[0]).sum()))
    for name, found in ranks.items():
        counts = np.bincount(np.array(found) // 5, minlength=10)
        assert stats.chisquare(counts).pvalue > 1e-4, name


def test_ranks_of_another_images_posterior_are_not_uniform(problem: AnalyticGrasping) -> None:
    """The check above has the power to fail."""
    rng, n = np.random.default_rng(9), 600
    truth = problem.sample_successes(n, rng)
    ranks = []
    for k in range(n):
        posterior = problem.posterior(truth.image[(k + 1) % n])
        log_prob = posterior.log_prob(Hands.cat([truth.hands[k : k + 1], posterior.sample(49, rng)]))
        ranks.append(int((log_prob[1:] < log_prob[0]).sum()))
    assert stats.chisquare(np.bincount(np.array(ranks) // 5, minlength=10)).pvalue < 1e-4


def test_gradients_agree_with_finite_differences(problem: AnalyticGrasping) -> None:
    rng = np.random.default_rng(10)
    posterior = problem.posterior(problem.sample_successes(1, rng).image[0])
    hands = PRIOR.sample(8, rng).to(dtype=torch.float64)
    position = hands.position.clone().requires_grad_()
    turn = torch.zeros(8, 3, dtype=torch.float64, requires_grad=True)

    def log_prob(x: torch.Tensor, w: torch.Tensor) -> torch.Tensor:
        return posterior.log_prob(Hands(x, hands.rotation @ so3.exp(w), hands.grasp_type))

    assert torch.autograd.gradcheck(log_prob, (position, turn), eps=1e-6, atol=1e-5)


def test_one_image_for_many_hands_and_many_images_for_one_hand(problem: AnalyticGrasping) -> None:
    rng = np.random.default_rng(11)
    draws = problem.sample_successes(4, rng)
    table = problem.log_ratio_image(draws.image[:, None], draws.hands[None])
    assert table.shape == (4, 4)
    torch.testing.assert_close(table.diagonal(), problem.log_ratio_image(draws.image, draws.hands))
    torch.testing.assert_close(table[2], problem.log_ratio_image(draws.image[2:3], draws.hands))


def test_default_problem_is_as_rare_as_the_paper() -> None:
    default = AnalyticGrasping(PRIOR)
    assert 0.003 < default.success_rate < 0.03
    assert default.sample_joint(2, np.random.default_rng(12)).image.shape == (2, 1, 20, 32)


def test_same_generator_same_draws(problem: AnalyticGrasping) -> None:
    first, second = (problem.sample_successes(20, np.random.default_rng(13)) for _ in range(2))
    assert torch.equal(first.image, second.image)
    assert torch.equal(first.hands.rotation, second.hands.rotation)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: AnalyticConfig(grid=(0, 1, 1)), "grid"),
        (lambda: AnalyticConfig(reach=-1.0), "reach"),
        (lambda: BarGraspConfig(deviation=(0.1, 0.0, 0.1)), "deviation"),
        (lambda: BarGraspConfig(weight=(0.5, 1.5, 0.5)), "weight"),
        (lambda: BarGraspConfig(height=(0.2, math.nan, 0.2)), "height"),
        (lambda: BarImage(noise=0.0), "noise"),
        (lambda: BarImage(size=(0, 4)), "size"),
        (lambda: AnalyticGrasping(GraspPrior(types=(0, 1))), "every grasp type"),
    ],
)
def test_bad_problems_are_refused(build, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InvalidConfigurationError, match=message):
        build()
