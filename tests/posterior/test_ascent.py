"""The batched conjugate-gradient search for the MAP."""

import pytest
import torch

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.known.analytic import AnalyticGrasping
from bayesgrasp.posterior.ascent import AscentConfig, Stop, ascend, find_map, starting_points, with_every_type
from bayesgrasp.posterior.potential import likelihood_potential, posterior_potential, prior_potential
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.seeding import generator
from bayesgrasp.types import Hands

PRIOR = GraspPrior()


def quadratic(center: Hands, stiffness: tuple[float, float, float] = (400.0, 900.0, 100.0), turn: float = 5.0):
    """A log-ratio with one maximum at `center`: -k/2 |x - c|^2 + turn trace(C^T R)."""

    def log_ratio(hands: Hands) -> torch.Tensor:
        shift = hands.position - center.position
        trace = (center.rotation * hands.rotation).sum((-2, -1))
        return -0.5 * (shift.new_tensor(stiffness) * shift.square()).sum(-1) + turn * trace

    return log_ratio


@pytest.fixture(scope="module")
def analytic():
    problem = AnalyticGrasping(PRIOR)
    rng = generator(8)
    draws = problem.sample_successes(4, rng)
    return problem, [draws.image[k] for k in range(4)]


def potential_of(problem: AnalyticGrasping, image: torch.Tensor):
    return posterior_potential(lambda hands: problem.log_success_given_image(image, hands), PRIOR)


def test_finds_the_maximum_of_a_known_likelihood() -> None:
    center = PRIOR.sample(1, generator(0))[0]
    potential = likelihood_potential(quadratic(center), PRIOR)
    found = ascend(potential, PRIOR.sample(20, generator(1)), AscentConfig(steps=100))
    assert (found.hands.position - center.position).abs().max() < 1e-3
    assert so3.geodesic_distance(found.hands.rotation, center.rotation).max() < 5e-3
    assert set(found.stop.tolist()) <= {Stop.SMALL_DECREASE, Stop.SMALL_GRADIENT, Stop.NO_DECREASE}


def test_an_optimum_outside_is_found_on_the_face_of_the_box() -> None:
    inside = PRIOR.sample(1, generator(2))[0]
    outside = Hands(torch.tensor([0.30, -0.02, 0.05]), inside.rotation, inside.grasp_type)
    found = ascend(
        likelihood_potential(quadratic(outside), PRIOR), PRIOR.sample(20, generator(3)), AscentConfig(steps=100)
    )
    expected = torch.tensor([0.15, -0.02, 0.12])
    assert (found.hands.position - expected).abs().max() < 1e-3
    assert PRIOR.in_support(found.hands).all()


def test_every_iterate_stays_inside_the_support(analytic) -> None:
    problem, images = analytic
    starts = PRIOR.sample(50, generator(4))
    for steps in (1, 3, 12):
        ends = ascend(potential_of(problem, images[0]), starts, AscentConfig(steps=steps))
        assert PRIOR.in_support(ends.hands).all()
        error = ends.hands.rotation @ ends.hands.rotation.mT - torch.eye(3)
        assert error.abs().max() < 1e-5


def test_no_start_gets_worse_and_steps_are_counted(analytic) -> None:
    problem, images = analytic
    potential = potential_of(problem, images[1])
    starts = PRIOR.sample(30, generator(5))
    ends = ascend(potential, starts, AscentConfig(steps=6))
    assert (ends.value <= potential.value(starts)).all()
    torch.testing.assert_close(potential.value(ends.hands), ends.value, atol=1e-4, rtol=1e-4)
    assert ends.steps.max() <= 6
    assert (ends.steps[ends.stop == Stop.MAX_STEPS] == 6).all()
    assert ends.evaluations >= 30 + int(ends.steps.sum())


def test_a_batch_ends_where_its_members_end_alone(analytic) -> None:
    problem, images = analytic
    potential = potential_of(problem, images[2])
    starts = PRIOR.sample(6, generator(6)).to(dtype=torch.float64)
    together = ascend(potential, starts)
    alone = [ascend(potential, starts[k : k + 1]) for k in range(6)]
    torch.testing.assert_close(together.value, torch.cat([a.value for a in alone]))
    assert together.stop.tolist() == [int(a.stop) for a in alone]
    assert together.evaluations == sum(a.evaluations for a in alone)


def test_map_beats_every_exact_draw_from_the_posterior(analytic) -> None:
    problem, images = analytic
    for image in images:
        potential = potential_of(problem, image)
        best = find_map(potential, PRIOR, generator(7), config=AscentConfig(starts_per_type=4, steps=40))
        draws = problem.posterior(image).sample(500, generator(8))
        assert best.value.min() <= potential.value(draws).min() + 1e-3


def test_mode_of_the_prior_is_found() -> None:
    best = find_map(prior_potential(PRIOR), PRIOR, generator(9)).best
    modes = PRIOR.sample(20000, generator(10))
    assert PRIOR.log_prob(best) >= PRIOR.log_prob(modes).max() - 1e-4


def test_starts_are_the_best_of_each_type() -> None:
    potential = prior_potential(PRIOR)
    hands = with_every_type(PRIOR.sample(100, generator(11)))
    value = potential.value(hands)
    starts = starting_points(hands, value, per_type=2)
    assert starts.grasp_type.tolist() == [0, 0, 1, 1, 2, 2]
    assert potential.value(starts).min() == value.min()


def test_types_without_support_are_left_out() -> None:
    prior = GraspPrior(types=(0, 2))
    found = find_map(prior_potential(prior), prior, generator(12), num_draws=50)
    assert set(found.hands.grasp_type.tolist()) == {0, 2}


def test_a_start_outside_is_reported_not_moved() -> None:
    starts = PRIOR.sample(2, generator(13))
    starts.position[0] = torch.tensor([1.0, 0.0, 0.2])
    ends = ascend(prior_potential(PRIOR), starts)
    assert ends.stop[0] == Stop.OUTSIDE
    assert ends.value[0].isinf()
    assert ends.stop[1] != Stop.OUTSIDE


def test_no_finite_candidate_is_an_error() -> None:
    hands = PRIOR.sample(3, generator(14))
    with pytest.raises(InvalidConfigurationError, match="none of 3 candidates"):
        starting_points(hands, torch.full((3,), torch.inf))


@pytest.mark.parametrize("wrong", [{"steps": 0}, {"starts_per_type": 0}, {"armijo": 0.7}, {"max_step": -1.0}])
def test_wrong_configurations_are_refused(wrong) -> None:
    with pytest.raises(InvalidConfigurationError):
        AscentConfig(**wrong)
