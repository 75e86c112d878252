"""From one depth image to ranked grasps that the arm can reach (paper, section 3.2, made fit for a robot).

    check -> view (canonical image) -> scene (is there anything to grasp?) -> encode -> search (MAP and MLE)
          -> reach (ranking, joint paths, clearance) -> samples

Everything that depends on the trained model, the sensor or the arm is handed in: this file knows none of them. Frames
are explained in `observation`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.observation.familiarity import Familiarity
from bayesgrasp.observation.surface import Surface, SurfaceReader
from bayesgrasp.observation.table import TableConfig, locate_workspace
from bayesgrasp.observation.user_camera import Intrinsics, aligned_workspace, check_depth, check_scale, to_camera
from bayesgrasp.planning.plan import Grasp, Plan
from bayesgrasp.planning.selection import Candidates, Robot, Selection, SelectionConfig
from bayesgrasp.posterior.ascent import AscentConfig, ascend, starting_points
from bayesgrasp.posterior.potential import LogDensity, Prior, tempered_potential
from bayesgrasp.posterior.sampling import SamplerConfig, sample_posterior
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Hands

View = Callable[[Float32[np.ndarray, "h w"], Camera], Float32[np.ndarray, "height width"]]
"""From a depth image (metres, 0 = no return) of any camera with a pose to the network's image."""


@dataclass(frozen=True)
class Posterior:
    """The trained part: the ratio of one image, and what its value says about success.

    Attributes:
        given_image: From the network's image (1, height, width) to log r(S=1, i | h), up to a constant.
        success_probability: From values of that log-ratio to estimates of p(S=1 | i, h).
    """

    given_image: Callable[[Tensor], LogDensity]
    success_probability: Callable[[Tensor], Tensor]


QUICK = AscentConfig(starts_per_type=4, steps=12, backtracks=4, decrease_tolerance=5e-3, gradient_tolerance=1e-2)
"""More starts than Algorithm 2, and no more precision than a robot can use."""


TEMPERS = (1.0, 0.0)
"""Weights of the log-prior in the ascents: they lead to the MAP and to the MLE."""


@dataclass(frozen=True)
class PlannerConfig:
    """Cost and behaviour of a plan.

    Attributes:
        num_draws: Draws from the prior that compete for the starts; more than in Algorithm 2, since each is tried with
            its own grasp type only.
        ascent: The search; by default four starts per grasp type for the maximum of the posterior, and as many for that
            of the likelihood inside the prior's box.
        fallbacks: Of the best draws, how many are tried where the ends of the search cannot be executed.
        alignment: The world is turned where the camera stands more than this off its side in training, radians.
        selection: What makes a grasp executable and distinct.
        sampler: Posterior samples.
        table: Search for the table where the camera's pose is unknown.
    """

    num_draws: int = 2000
    ascent: AscentConfig = QUICK
    fallbacks: int = 30
    alignment: float = 0.35
    selection: SelectionConfig = field(default_factory=SelectionConfig)
    sampler: SamplerConfig = field(default_factory=SamplerConfig)
    table: TableConfig = field(default_factory=TableConfig)

    def __post_init__(self) -> None:
        if self.num_draws < 1 or self.fallbacks < 0 or self.alignment < 0:
            raise InvalidConfigurationError("a plan needs num_draws >= 1, fallbacks >= 0 and alignment >= 0")


@dataclass(frozen=True)
class Planner:
    """Depth image in, ranked grasps out.

    Attributes:
        posterior: The trained ratio.
        prior: p(h).
        view: Re-projection into the canonical view.
        reader: Points of that view.
        robot: The hand and the arm.
        familiarity: What training images look like; None if the model does not say.
        config: Cost and behaviour.
    """

    posterior: Posterior
    prior: Prior
    view: View
    reader: SurfaceReader
    robot: Robot
    familiarity: Familiarity | None = None
    config: PlannerConfig = field(default_factory=PlannerConfig)

    def plan(
        self,
        depth: np.ndarray,
        intrinsics: Intrinsics,
        camera_to_world: Float[np.ndarray, "4 4"] | None = None,
        *,
        top: int = 5,
        samples: int = 0,
        seed: int | np.random.Generator = 0,
    ) -> Plan:
        """Plan grasps for one image.

        Args:
            depth: Depth image (h, w), floating point, metres, 0 = no return.
            intrinsics: A `Camera`, its six numbers by name, or the matrix K.
            camera_to_world: Pose of the camera; by default that of the `Camera`. Where neither is known, table and
                object are found in the image and the world frame is put there.
            top: Number of grasps.
            samples: Number of draws from the posterior; none by default.
            seed: Of all random draws, or where they come from; the same seed gives the same plan.

        Raises:
            DepthImageError: The image or the camera is not usable.
        """
        if top < 1 or samples < 0:
            raise InvalidConfigurationError(f"top must be at least 1 and samples at least 0, got {top} and {samples}")
        if not isinstance(seed, np.random.Generator) and seed < 0:
            raise InvalidConfigurationError(f"the seed must be at least 0, got {seed}")
        rng = seed if isinstance(seed, np.random.Generator) else generator(seed, Stream.PLAN)
        return _Planning(self, rng).run(
            check_depth(depth), to_camera(intrinsics, depth.shape, camera_to_world), top, samples
        )


class _Planning:
    """One plan in the making."""

    def __init__(self, planner: Planner, rng: np.random.Generator) -> None:
        self.planner, self.config, self.rng = planner, planner.config, rng
        self.timings: dict[str, float] = {}
        self.warnings: list[str] = []

    def run(self, depth: Float32[np.ndarray, "h w"], camera: Camera, top: int, samples: int) -> Plan:
        started = time.perf_counter()
        with self._stage("view"):
            camera = self._with_pose(depth, camera)
            check_scale(depth, camera)
            workspace_to_world = aligned_workspace(camera.pose, self.config.alignment)
            world_to_workspace = np.linalg.inv(workspace_to_world)
            image = self.planner.view(depth, camera.with_pose(world_to_workspace @ camera.pose))
        with self._stage("scene"):
            surface = self.planner.reader.read(image)
            reason = surface.problem()
            cleared = self.planner.reader.cleared(image, surface)
            seen = surface if cleared is image else self.planner.reader.read(cleared, surface.item)
            unfamiliarity = None if reason else self._unfamiliarity(seen)
            image = cleared
        grasps: tuple[Grasp, ...] = ()
        drawn = None
        if reason is None:
            with self._stage("encode"):
                log_ratio = self.planner.posterior.given_image(torch.from_numpy(image)[None])
            with self._stage("search"):
                candidates = _search(self.planner, log_ratio, self.rng)
            with self._stage("reach"):
                frames = camera.pose, workspace_to_world
                selection = Selection(self.planner.robot, surface, *frames, self.config.selection)
                grasps, reason = selection.select(candidates, top)
            if samples:
                with self._stage("samples"):
                    drawn = sample_posterior(log_ratio, self.planner.prior, samples, self.rng, self.config.sampler)
        self.timings["total"] = 1e3 * (time.perf_counter() - started)
        return Plan(
            grasps,
            reason,
            tuple(self.warnings),
            unfamiliarity,
            camera.pose,
            workspace_to_world,
            image,
            surface,
            drawn,
            self.timings,
        )

    def _with_pose(self, depth: Float32[np.ndarray, "h w"], camera: Camera) -> Camera:
        if camera.camera_to_world is not None:
            return camera
        self.warnings.append(
            "camera_to_world was not given: the world frame is the one found in the image, with its origin on the "
            "table below the object and x towards the camera's side; joint paths hold only if the arm stands in it as "
            "in training"
        )
        return camera.with_pose(locate_workspace(depth, camera, self.rng, self.config.table))

    def _unfamiliarity(self, surface: Surface) -> float | None:
        familiarity = self.planner.familiarity
        if familiarity is None:
            return None
        score = familiarity.distance(surface) / familiarity.threshold
        if score > 1:
            self.warnings.append(
                f"the image is unlike the training images (score {score:.1f}, above 1 is unfamiliar): "
                f"{familiarity.strangest(surface)}"
            )
        return score

    @contextmanager
    def _stage(self, name: str) -> Iterator[None]:
        started = time.perf_counter()
        yield
        self.timings[name] = 1e3 * (time.perf_counter() - started)


def _search(planner: Planner, log_ratio: LogDensity, rng: np.random.Generator) -> Candidates:
    """Ends of the ascents, and the best draws from the prior."""
    config, prior = planner.config, planner.prior
    draws = prior.sample(config.num_draws, rng)
    with torch.no_grad():
        ratio, log_prior = log_ratio(draws), prior.log_prob(draws)
    per_type = config.ascent.starts_per_type
    starts = [starting_points(draws, -(ratio + weight * log_prior), per_type) for weight in TEMPERS]
    weight = torch.cat([torch.full(hands.shape, weight) for weight, hands in zip(TEMPERS, starts, strict=True)])
    ends = ascend(tempered_potential(log_ratio, prior, weight), Hands.cat(starts), config.ascent).hands
    log_evidence = torch.logsumexp(ratio, 0) - math.log(config.num_draws)
    hands = Hands.cat([ends, draws[(-(ratio + log_prior)).argsort()[: config.fallbacks]]])
    with torch.no_grad():
        ratio, log_prior = log_ratio(hands), prior.log_prob(hands)
    return Candidates(hands, ratio + log_prior - log_evidence, planner.posterior.success_probability(ratio))
