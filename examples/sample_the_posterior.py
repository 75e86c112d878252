"""The whole posterior p(h | S=1, i) of one image: draws, densities, marginals and the mode.

    python examples/sample_the_posterior.py

A grasp is one answer; the posterior says what else would work and how sure that is. A can stands alone on the table, so
a hand may come from many sides, and the marginal of the approach direction shows from which.
"""

import numpy as np

import bayesgrasp as bg


def main(draws: int = 2000) -> bg.Posterior:
    """Plan on an image and look at its posterior.

    Args:
        draws: How many hands to draw.
    """
    situation = bg.SceneMaker(bg.load_objects(["household_drink_can"]), seed=0).make(0)
    posterior = bg.load().posterior(situation.depth, bg.canonical_camera())

    drawn = posterior.sample(draws, seed=0)
    print(f"{draws} draws, worth {drawn.effective_sample_size:.0f} independent ones")
    print(f"log-density of the draws: {posterior.log_prob(drawn.hands).mean():.1f} nats on average")
    print(f"p(S=1 | i, h) of the draws: {posterior.success_probability(drawn.hands).mean():.2f} on average")

    marginals = posterior.marginals(draws, seed=0, bins=8)
    for grasp_type in bg.GraspType:
        print(f"p({grasp_type.name.lower():5} | S=1, i) = {marginals.grasp_type[grasp_type]:.2f}")
    bands = marginals.approach.density.sum(axis=1)
    tilts = np.degrees(np.arccos(-marginals.approach.height))
    for share, low, high in zip(bands / bands.sum(), tilts[:-1], tilts[1:], strict=True):
        print(f"approach {low:3.0f} to {high:3.0f} degrees from straight down: {100 * share:3.0f} %")

    mode = posterior.mode(seed=0)
    print(f"mode: palm at {np.round(mode.position.numpy(), 3)} m, {posterior.log_prob(mode):.1f} nats")
    return posterior


if __name__ == "__main__":
    main()
