"""A small grasping problem on R^3 x SO(3) x G whose posterior is known, to judge the whole chain against the truth.

A bar lies on the table at o, one of K equally likely poses. A hand from the given prior lifts it with a probability
p(S=1 | h, o) in closed form (`bar_grasp`), and a noisy depth image shows it (`bar_image`). Since o is one of finitely
many poses, everything of the paper's section 3.1 is a finite sum. With Z_o = E_{p(h)} p(S=1 | h, o), Z = mean_o Z_o:

    p(S=1 | i, h) = sum_o p(o | i) p(S=1 | h, o),              p(S=1 | h) = mean_o p(S=1 | h, o),
    r(S=1 | h) = p(S=1 | h) / Z,
    r(i | S=1, h) = (p(S=1 | i, h) / p(S=1 | h)) (Z / sum_o p(o | i) Z_o),
    p(h | S=1, i) = p(h) p(S=1 | i, h) / sum_o p(o | i) Z_o = p(h) r(S=1 | h) r(i | S=1, h).

Draws from the posterior are exact and independent: o given i and S=1, then h given o and S=1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Float64, Int64
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.known.bar_grasp import BarGrasp, BarGraspConfig, HandPrior
from bayesgrasp.known.bar_image import BarImage
from bayesgrasp.types import Hands


@dataclass(frozen=True)
class AnalyticConfig:
    """The problem. With the defaults and the paper's prior 0.8 % of the hands succeed, as in the paper.

    Attributes:
        grid: Number of object places along x and along y, and of yaws in [0, pi).
        reach: Object places span [-reach, reach], metres.
        grasp: The lift test.
        image: The image; its default noise leaves some doubt about the pose.

    Raises:
        InvalidConfigurationError: A count below 1, or a negative reach.
    """

    grid: tuple[int, int, int] = (5, 5, 6)
    reach: float = 0.06
    grasp: BarGraspConfig = field(default_factory=BarGraspConfig)
    image: BarImage = field(default_factory=BarImage)

    def __post_init__(self) -> None:
        if min(self.grid) < 1:
            raise InvalidConfigurationError(f"grid must be three whole numbers >= 1, got {self.grid}")
        if not (math.isfinite(self.reach) and self.reach >= 0):
            raise InvalidConfigurationError(f"reach must be finite and >= 0 m, got {self.reach}")

    @property
    def poses(self) -> Float64[np.ndarray, "K 3"]:
        """The possible object poses (x, y, yaw), metres and radians; yaw varies fastest."""
        nx, ny, turns = self.grid
        x, y = (np.linspace(-self.reach, self.reach, n) if n > 1 else np.zeros(1) for n in (nx, ny))
        return np.stack(np.meshgrid(x, y, np.arange(turns) * np.pi / turns, indexing="ij"), -1).reshape(-1, 3)


@dataclass(frozen=True)
class AnalyticDraws:
    """Joint draws of all variables.

    Attributes:
        hands: h.
        success: S.
        image: i, metres.
        pose_index: o, as a row of `AnalyticGrasping.poses`.
    """

    hands: Hands
    success: Bool[Tensor, "n"]
    image: Float32[Tensor, "n 1 height width"]
    pose_index: Int64[np.ndarray, "n"]


class AnalyticGrasping:
    """The problem for one prior.

    Args:
        prior: p(h), uniform in a box of positions.
        config: The rest.

    Raises:
        InvalidConfigurationError: The prior excludes a grasp type.
    """

    def __init__(self, prior: HandPrior, config: AnalyticConfig | None = None) -> None:
        self.prior = prior
        self.config = config or AnalyticConfig()
        self.poses = self.config.poses
        self.grasp = BarGrasp(prior, self.poses, self.config.grasp)
        self._templates = self.config.image.templates(self.poses)

    @cached_property
    def success_rate(self) -> float:
        """Z = p(S=1)."""
        return float(self.grasp.log_evidence.exp().mean())

    def log_success(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Logarithm of p(S=1 | h)."""
        return torch.logsumexp(self.grasp.log_success(hands), -1) - math.log(len(self.poses))

    def log_success_given_image(
        self, image: Float[Tensor, "*#batch 1 height width"], hands: Hands
    ) -> Float[Tensor, "*#batch"]:
        """Logarithm of p(S=1 | i, h); image and hands are broadcast against each other."""
        log_pose = self.log_pose_given_image(image).to(hands.position.dtype)
        return torch.logsumexp(log_pose + self.grasp.log_success(hands), -1)

    def log_ratio_success(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Logarithm of r(S=1 | h)."""
        return self.log_success(hands) - math.log(self.success_rate)

    def log_ratio_image(self, image: Float[Tensor, "*#batch 1 height width"], hands: Hands) -> Float[Tensor, "*#batch"]:
        """Logarithm of r(i | S=1, h); image and hands are broadcast against each other."""
        evidence = self.log_evidence_given_image(image).to(hands.position.dtype)
        return self.log_success_given_image(image, hands) - evidence - self.log_ratio_success(hands)

    def log_pose_given_image(self, image: Float[Tensor, "*batch 1 height width"]) -> Float64[Tensor, "*batch K"]:
        """Logarithm of p(o | i)."""
        return self.config.image.log_pose(image, self._templates)

    def log_evidence_given_image(self, image: Float[Tensor, "*batch 1 height width"]) -> Float64[Tensor, "*batch"]:
        """Logarithm of p(S=1 | i), the normaliser of the posterior."""
        return torch.logsumexp(self.log_pose_given_image(image) + self.grasp.log_evidence, -1)

    def posterior(self, image: Float[Tensor, "1 height width"]) -> AnalyticPosterior:
        """p(h | S=1, i) for one image."""
        return AnalyticPosterior(self, image)

    def sample_joint(self, n: int, rng: np.random.Generator) -> AnalyticDraws:
        """Draws from p(h) p(o) p(S | h, o) p(i | o)."""
        hands, success, index = self.sample_attempts(n, rng)
        return AnalyticDraws(hands, success, self.sample_image(index, rng), index)

    def sample_attempts(
        self, n: int, rng: np.random.Generator
    ) -> tuple[Hands, Bool[Tensor, "{n}"], Int64[np.ndarray, "{n}"]]:
        """Draws of (h, S, o) from p(h) p(o) p(S | h, o): lift tests, without images."""
        hands, index = self.prior.sample(n, rng), rng.integers(len(self.poses), size=n)
        log_success = self.grasp.log_success(hands).gather(-1, torch.from_numpy(index)[:, None]).squeeze(-1)
        return hands, torch.from_numpy(rng.random(n)) < log_success.exp(), index

    def sample_successes(self, n: int, rng: np.random.Generator) -> AnalyticDraws:
        """Draws from p(h, o, i | S=1), without waiting for successes."""
        # All poses are equally likely, so p(o | S=1) is proportional to Z_o; then h given o and S=1.
        index = rng.choice(len(self.poses), size=n, p=torch.softmax(self.grasp.log_evidence, -1).numpy())
        hands = self.grasp.sample_hands(index, rng)
        return AnalyticDraws(hands, torch.ones(n, dtype=torch.bool), self.sample_image(index, rng), index)

    def sample_image(
        self, index: Int64[np.ndarray, "n"], rng: np.random.Generator
    ) -> Float32[Tensor, "n 1 height width"]:
        """Draws from p(i | o), one for each pose index."""
        return self.config.image.sample(self._templates[index], rng)


class AnalyticPosterior:
    """p(h | S=1, i), normalised, with exact draws."""

    def __init__(self, problem: AnalyticGrasping, image: Float[Tensor, "1 height width"]) -> None:
        self.problem = problem
        self.image = image
        self.log_evidence = float(problem.log_evidence_given_image(image))

    def log_prob(self, hands: Hands) -> Float[Tensor, "*batch"]:
        """Log density, in the prior's measure; differentiable in position and rotation."""
        log_success = self.problem.log_success_given_image(self.image, hands)
        return self.problem.prior.log_prob(hands) + log_success - self.log_evidence

    def sample(self, n: int, rng: np.random.Generator) -> Hands:
        """Independent draws, float32."""
        # p(o | S=1, i) is proportional to p(o | i) Z_o, since S does not depend on i given o; then h given o and S=1.
        log_weight = self.problem.log_pose_given_image(self.image) + self.problem.grasp.log_evidence
        index = rng.choice(len(log_weight), size=n, p=torch.softmax(log_weight, -1).numpy())
        return self.problem.grasp.sample_hands(index, rng)
