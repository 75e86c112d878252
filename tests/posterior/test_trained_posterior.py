"""Both samplers and the search on the posterior of the shipped model."""

import pytest
import torch
from box_scene import Box, box_depth_image

import bayesgrasp
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.observation.preprocess import preprocess
from bayesgrasp.posterior.ascent import AscentConfig, find_map
from bayesgrasp.posterior.importance import weigh
from bayesgrasp.posterior.potential import posterior_potential
from bayesgrasp.posterior.sampling import SamplerConfig, sample_posterior
from bayesgrasp.seeding import generator
from bayesgrasp.types import Hands
from bayesgrasp.workflows.load import DEFAULT_MODEL


@pytest.fixture(scope="module")
def trained():
    """The prior and the log-ratio of one image."""
    if not (DEFAULT_MODEL / "card.json").exists():
        pytest.skip(f"no trained model is shipped in {DEFAULT_MODEL.name}/")
    planner = bayesgrasp.load()
    image = torch.from_numpy(preprocess(box_depth_image(canonical_camera(), (Box(x=0.01, yaw=0.3),))))
    return planner.prior, planner.likelihood.given_image(image[None])


def features(hands: Hands) -> torch.Tensor:
    """Means of these are compared: position, rotation, type."""
    kinds = torch.nn.functional.one_hot(hands.grasp_type, 3)
    return torch.cat([hands.position, hands.rotation.flatten(-2), kinds], -1).double()


def test_importance_and_chains_agree(trained) -> None:
    prior, log_ratio = trained
    weighted = weigh(log_ratio, prior, 40_000, generator(0))
    drawn = sample_posterior(log_ratio, prior, 3000, generator(1), SamplerConfig(num_draws=20_000))
    weight, values = weighted.weight[:, None], features(weighted.hands)
    mean = (weight * values).sum(0)
    spread = ((weight * values.square()).sum(0) - mean.square()).sqrt()
    error = spread * (1 / weighted.effective_sample_size + 1 / drawn.effective_sample_size) ** 0.5
    assert weighted.effective_sample_size > 50
    assert ((features(drawn.hands).mean(0) - mean).abs() < 4 * error + 1e-6).all()


def test_the_map_is_inside_and_beats_the_draws(trained) -> None:
    prior, log_ratio = trained
    potential = posterior_potential(log_ratio, prior)
    found = find_map(potential, prior, generator(2), config=AscentConfig(starts_per_type=4))
    assert prior.in_support(found.hands).all()
    assert found.value.min() < potential.value(prior.sample(10_000, generator(3))).min()
