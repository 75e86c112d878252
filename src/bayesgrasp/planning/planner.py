"""From one depth image to ranked grasps that the arm can reach (paper, section 3.2, made fit for a robot).

    check -> view (canonical image) -> scene (is there anything to grasp?) -> encode -> search (MAP and MLE)
          -> reach (ranking, joint paths, clearance) -> samples

Everything that depends on the trained model, the sensor or the arm is handed in: this file knows none of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from bayesgrasp.errors import DepthImageError, InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.observation.user_camera import Intrinsics, check_depth, to_camera
from bayesgrasp.planning.constraints import UNCONSTRAINED, ConstraintCheck, Constraints
from bayesgrasp.planning.observing import Observed, Observer, Stopwatch
from bayesgrasp.planning.plan import Grasp, Plan
from bayesgrasp.planning.search import SearchConfig, search
from bayesgrasp.planning.selection import Candidates, Robot, Selection, SelectionConfig
from bayesgrasp.posterior.importance import Weighted, estimate_evidence, weigh
from bayesgrasp.posterior.posterior import Posterior, Seed
from bayesgrasp.posterior.potential import LogDensity, Prior
from bayesgrasp.posterior.sampling import SamplerConfig
from bayesgrasp.seeding import Stream, generator_of


@runtime_checkable
class Delivered(Protocol):
    """What plans delivered on objects that no training had met."""

    @property
    def objects(self) -> str:
        """Which objects, in words."""
        ...

    def least_promise(self, wanted: float) -> float | None:
        """The least success probability of grasps that succeed at the wanted rate; None where none is enough."""
        ...


@dataclass(frozen=True)
class TrainedLikelihood:
    """What was learned: the ratio of one image, and what its value says about success.

    Attributes:
        given_image: From the network's image (1, height, width) to log r(S=1, i | h), up to a constant, of hands in the
            workspace frame.
        success_probability: From values of that log-ratio to estimates of p(S=1 | i, h).
        delivered: What plans delivered on fresh objects; None where the model does not know.
        device: Where images and hands are taken.
        held_given_image: From the network's image to log p(held | i, h); None where the model does not know.
    """

    given_image: Callable[[Tensor], LogDensity]
    success_probability: Callable[[Tensor], Tensor]
    delivered: Delivered | None = None
    device: torch.device = field(default_factory=lambda: torch.device("cpu"))
    held_given_image: Callable[[Tensor], LogDensity] | None = None


@dataclass(frozen=True)
class PlannerConfig:
    """Cost and behaviour of a plan.

    Attributes:
        search: Candidates.
        selection: What makes a grasp executable and distinct, and which is better.
        sampler: Posterior samples.
    """

    search: SearchConfig = field(default_factory=SearchConfig)
    selection: SelectionConfig = field(default_factory=SelectionConfig)
    sampler: SamplerConfig = field(default_factory=SamplerConfig)


@dataclass(frozen=True)
class Planner:
    """Depth image in, ranked grasps out.

    Attributes:
        likelihood: The trained ratio.
        prior: p(h).
        observer: Reads images.
        robot: The hand and the arm.
        config: Cost and behaviour.
    """

    likelihood: TrainedLikelihood
    prior: Prior
    observer: Observer
    robot: Robot
    config: PlannerConfig = field(default_factory=PlannerConfig)

    def __post_init__(self) -> None:
        if self.config.selection.rank == "held" and self.likelihood.held_given_image is None:
            raise InvalidConfigurationError(
                "this model does not know how likely a grasp is to hold against pushes: rank by success or posterior"
            )

    def refining_pose(self) -> Planner:
        """The same planner, which corrects tilt and height of a camera's stated pose by the table that it sees."""
        config = replace(self.observer.config, refine_pose=True)
        return replace(self, observer=replace(self.observer, config=config))

    def plan(
        self,
        depth: np.ndarray,
        intrinsics: Intrinsics,
        camera_to_world: Float[np.ndarray, "4 4"] | None = None,
        *,
        top: int = 5,
        samples: int = 0,
        constraints: Constraints = UNCONSTRAINED,
        seed: Seed = 0,
    ) -> Plan:
        """Plan grasps for one image.

        Args:
            depth: Depth image (h, w), floating point, metres, 0 = no return.
            intrinsics: A `Camera`, its six numbers by name, or the matrix K.
            camera_to_world: Pose of the camera; by default that of the `Camera`. Where neither is known, table and
                object are found in the image and the world frame is put there.
            top: Number of grasps.
            samples: Number of draws from the posterior; none by default.
            constraints: What the grasps must keep to, world frame; the posterior does not depend on them.
            seed: Of all random draws, or where they come from; the same seed gives the same plan.

        Raises:
            DepthImageError: The image or the camera is not usable.
            InvalidConfigurationError: A confidence is asked for that this model cannot judge.
        """
        wanted = _Wanted(top, samples, constraints)
        rng = generator_of(seed, Stream.PLAN)
        return self._answer(*_checked(depth, intrinsics, camera_to_world), wanted, rng)

    def plan_many(
        self,
        images: Iterable[tuple[np.ndarray, Intrinsics]],
        *,
        top: int = 5,
        samples: int = 0,
        constraints: Constraints = UNCONSTRAINED,
        seed: int = 0,
    ) -> tuple[Plan, ...]:
        """Plan grasps for several images, each a depth image with its camera.

        Every image is planned with the same seed, so its plan is the one that `plan` makes of it alone. All images are
        checked before the first is planned.

        Args:
            images: Pairs of what `plan` takes as `depth` and `intrinsics`.
            top: Number of grasps for each.
            samples: Number of draws from each posterior.
            constraints: What all grasps must keep to.
            seed: Of all random draws for each.

        Raises:
            DepthImageError: An image or a camera is not usable; the message has its number, from 0.
        """
        wanted, checked = _Wanted(top, samples, constraints), []
        for number, (depth, intrinsics) in enumerate(images):
            try:
                checked.append(_checked(depth, intrinsics, None))
            except DepthImageError as error:
                raise DepthImageError(f"image {number}: {error}") from error
        return tuple(self._answer(*image, wanted, generator_of(seed, Stream.PLAN)) for image in checked)

    def posterior(
        self,
        depth: np.ndarray,
        intrinsics: Intrinsics,
        camera_to_world: Float[np.ndarray, "4 4"] | None = None,
        *,
        seed: Seed = 0,
    ) -> Posterior:
        """p(h | S=1, i) of one image, which `plan` with the same seed plans from.

        Args:
            depth: As for `plan`.
            intrinsics: As for `plan`.
            camera_to_world: As for `plan`.
            seed: Of the draws from the prior behind its constant.

        Raises:
            DepthImageError: The image or the camera is not usable, or there is nothing to grasp.
        """
        rng, watch = generator_of(seed, Stream.PLAN), Stopwatch()
        observed = self.observer.observe(*_checked(depth, intrinsics, camera_to_world), rng, watch)
        if observed.problem is not None:
            raise DepthImageError(f"there is no posterior of grasps for this image: {observed.problem}")
        return self._infer(observed, rng, watch)[0]

    def _answer(
        self, depth: Float32[np.ndarray, "h w"], camera: Camera, wanted: _Wanted, rng: np.random.Generator
    ) -> Plan:
        watch = Stopwatch()
        least, reason = self._least_success(wanted.constraints.confidence)
        observed = self.observer.observe(depth, camera, rng, watch)
        reason = observed.problem or reason
        if reason is not None:
            return Plan((), reason, observed, wanted.constraints, None, None, watch.stop())
        posterior, drawn = self._infer(observed, rng, watch)
        with watch.stage("search"):
            check = self._check(wanted.constraints, observed)
            candidates, reason = search(posterior, drawn, self.config.search, check, rng)
        grasps: tuple[Grasp, ...] = ()
        if candidates is not None:
            with watch.stage("reach"):
                candidates = self._with_held(candidates, observed)
                selection = Selection(self.robot, observed, replace(self.config.selection, least_success=least))
                grasps, reason = selection.select(candidates, wanted.top)
        samples = None
        if wanted.samples:
            with watch.stage("samples"):
                samples = posterior.sample(wanted.samples, rng)
        return Plan(grasps, reason, observed, wanted.constraints, posterior, samples, watch.stop())

    def _with_held(self, candidates: Candidates, observed: Observed) -> Candidates:
        """The candidates with their probability of holding against pushes, where the model knows it."""
        likelihood = self.likelihood
        if likelihood.held_given_image is None:
            return candidates
        image = torch.from_numpy(observed.image)[None].to(likelihood.device)
        with torch.no_grad():
            held = likelihood.held_given_image(image)(candidates.hands.to(likelihood.device)).exp().cpu()
        return replace(candidates, held=held)

    def _check(self, constraints: Constraints, observed: Observed) -> ConstraintCheck | None:
        if not constraints.limits_hands:
            return None
        standoff = self.config.selection.standoff
        return ConstraintCheck(constraints, self.robot.hand, standoff, observed.workspace_to_world)

    def _least_success(self, confidence: float | None) -> tuple[float, str | None]:
        """The least success probability of a grasp, or the reason why none is enough."""
        least = self.config.selection.least_success
        if confidence is None:
            return least, None
        delivered = self.likelihood.delivered
        if delivered is None:
            raise InvalidConfigurationError(
                "this model does not know what its plans deliver on fresh objects, so no confidence can be asked of "
                "it: let `bayesgrasp calibrate` find out, or ask for none"
            )
        promise = delivered.least_promise(confidence)
        if promise is None:
            return 1.0, (
                f"not confident enough: no promise of this model was found to succeed in {100 * confidence:.4g} % on "
                f"fresh objects ({delivered.objects})"
            )
        return max(least, promise), None

    def _infer(self, observed: Observed, rng: np.random.Generator, watch: Stopwatch) -> tuple[Posterior, Weighted]:
        """The posterior of an image, and the draws from the prior behind its constant."""
        device = self.likelihood.device
        with watch.stage("encode"):
            log_ratio = self.likelihood.given_image(torch.from_numpy(observed.image)[None].to(device))
        with watch.stage("search"):
            drawn = weigh(log_ratio, self.prior, self.config.search.num_draws, rng, device)
            posterior = Posterior(
                log_ratio,
                self.prior,
                estimate_evidence(drawn.log_ratio),
                self.likelihood.success_probability,
                observed.workspace_to_world,
                device,
                self.config.sampler,
            )
        return posterior, drawn


@dataclass(frozen=True)
class _Wanted:
    """What is asked of a plan."""

    top: int
    samples: int
    constraints: Constraints

    def __post_init__(self) -> None:
        if self.top < 1 or self.samples < 0:
            raise InvalidConfigurationError(
                f"top must be at least 1 and samples at least 0, got {self.top} and {self.samples}"
            )


def _checked(
    depth: np.ndarray, intrinsics: Intrinsics, camera_to_world: Float[np.ndarray, "4 4"] | None
) -> tuple[Float32[np.ndarray, "h w"], Camera]:
    return check_depth(depth), to_camera(intrinsics, depth.shape, camera_to_world)
