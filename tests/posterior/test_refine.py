"""The search without gradients: maxima that are known, groups, faces of the box, and the same draws for a seed."""

import pytest
import torch

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.known.analytic import AnalyticGrasping
from bayesgrasp.posterior.ascent import starting_points
from bayesgrasp.posterior.potential import likelihood_potential, posterior_potential, tempered_potential
from bayesgrasp.posterior.refine import RefineConfig, refine
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.seeding import generator
from bayesgrasp.types import Hands

PRIOR = GraspPrior()


def peak(center: Hands, ripples: float = 0.05):
    """A log-ratio with one maximum, and ripples that stop a gradient."""

    def log_ratio(hands: Hands) -> torch.Tensor:
        shift = (hands.position - center.position).square().sum(-1).sqrt()
        angle = so3.geodesic_distance(hands.rotation, center.rotation)
        return -10 * shift - angle - ripples * (torch.sin(900 * shift).abs() + torch.sin(90 * angle).abs())

    return log_ratio


def groups(hands: Hands, count: int = 1) -> torch.Tensor:
    return torch.arange(len(hands.grasp_type)) % count


def test_finds_a_maximum_among_ripples() -> None:
    center = PRIOR.sample(1, generator(0))[0]
    potential = likelihood_potential(peak(center), PRIOR)
    drawn = PRIOR.sample(500, generator(1))
    starts = starting_points(drawn, potential.value(drawn), 4)
    ends = refine(potential, starts, groups(starts), generator(2))
    assert potential.value(ends).min() < potential.value(starts).min() / 4
    assert potential.value(ends).min() < 0.12


def test_comes_as_close_as_the_best_of_many_exact_draws() -> None:
    problem = AnalyticGrasping(PRIOR)
    images = problem.sample_successes(3, generator(3)).image
    for number, image in enumerate(images):
        potential = posterior_potential(lambda h, i=image: problem.log_success_given_image(i, h), PRIOR)
        drawn = PRIOR.sample(1000, generator(4))
        starts = starting_points(drawn, potential.value(drawn), 4)
        ends = refine(potential, starts, groups(starts), generator(5, number))
        draws = problem.posterior(image).sample(2000, generator(6))
        assert potential.value(ends).min() <= potential.value(draws).min() + 0.05


def test_no_start_gets_worse_or_is_lost_and_types_stay() -> None:
    center = PRIOR.sample(1, generator(0))[0]
    potential = likelihood_potential(peak(center), PRIOR)
    starts = PRIOR.sample(30, generator(7))
    ends = refine(potential, starts, groups(starts), generator(8))
    assert len(ends.grasp_type) == 30
    assert sorted(ends.grasp_type.tolist()) == sorted(starts.grasp_type.tolist())
    assert (potential.value(ends).sort().values <= potential.value(starts).sort().values + 1e-6).all()
    assert PRIOR.in_support(ends).all()


def test_an_optimum_outside_is_found_on_the_face_of_the_box() -> None:
    inside = PRIOR.sample(1, generator(2))[0]
    outside = Hands(torch.tensor([0.30, -0.02, 0.20]), inside.rotation, inside.grasp_type)
    potential = likelihood_potential(peak(outside, ripples=0.0), PRIOR)
    starts = PRIOR.sample(40, generator(9))
    ends = refine(potential, starts, groups(starts), generator(10))
    best = ends[potential.value(ends).argmin()]
    assert PRIOR.in_support(ends).all()
    assert best.position[0] == pytest.approx(0.15, abs=1e-6)


def test_groups_compete_among_themselves_and_keep_their_own_weight() -> None:
    """Rows of weight 1 lead to the MAP, those of weight 0 to the MLE, which differ."""
    center = PRIOR.sample(1, generator(0))[0]
    ratio = peak(center)
    starts = PRIOR.sample(40, generator(11))
    goal = groups(starts, 2)
    potential = tempered_potential(ratio, PRIOR, torch.tensor([1.0, 0.0])[goal])
    ends = refine(potential, starts, goal, generator(12))
    for make in (posterior_potential, likelihood_potential):
        alone = make(ratio, PRIOR)
        only = refine(alone, starts, groups(starts), generator(13))
        assert alone.value(ends).min() <= alone.value(only).min() + 0.25


def test_what_is_not_allowed_is_never_entered() -> None:
    center = PRIOR.sample(1, generator(0))[0]
    plain = likelihood_potential(peak(center), PRIOR)
    left = PRIOR.sample(200, generator(14))
    left = left[left.position[:, 0] < center.position[0] - 0.02]

    def allowed(hands: Hands) -> torch.Tensor:
        return hands.position[:, 0] < center.position[0] - 0.02

    potential = type(plain)(plain.terms, plain.box, allowed=allowed)
    ends = refine(potential, left, groups(left), generator(15))
    assert allowed(ends).all()
    assert ends.position[:, 0].max() > center.position[0] - 0.025


def test_the_same_seed_gives_the_same_hands() -> None:
    potential = likelihood_potential(peak(PRIOR.sample(1, generator(0))[0]), PRIOR)
    starts = PRIOR.sample(10, generator(16))
    first, second = (refine(potential, starts, groups(starts), generator(17)) for _ in range(2))
    assert torch.equal(first.position, second.position)
    assert torch.equal(first.rotation, second.rotation)


@pytest.mark.parametrize(
    "wrong", [{"steps": ()}, {"steps": (0.1,)}, {"trials": 0}, {"kept": (1, 2) * 4}, {"kept": (0,) * 8}]
)
def test_wrong_schedules_are_refused(wrong) -> None:
    with pytest.raises(InvalidConfigurationError):
        RefineConfig(**wrong)
