"""From the user's image to what the network sees, and what stands on the table: the first two stages of a plan.

    view     the camera's pose, given (and doubted) or found; the workspace frame; the canonical image
    scene    the measured points; is there anything to grasp; what stands away from it is cleared; is the image familiar

Frames are explained in `observation.user_camera`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Float32, Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.observation.doubts import DoubtConfig, doubts
from bayesgrasp.observation.familiarity import Familiarity
from bayesgrasp.observation.stated_pose import see_table
from bayesgrasp.observation.surface import Surface, SurfaceReader
from bayesgrasp.observation.table import TableConfig, locate_workspace
from bayesgrasp.observation.user_camera import aligned_workspace, check_scale
from bayesgrasp.seeding import Stream, generator

View = Callable[[Float32[np.ndarray, "h w"], Camera], Float32[np.ndarray, "height width"]]
"""From a depth image (metres, 0 = no return) of any camera with a pose to the network's image."""
Pose = Float64[np.ndarray, "4 4"]


@dataclass(frozen=True)
class ObserverConfig:
    """Where the workspace is put, and when the camera's stated pose is doubted.

    Attributes:
        alignment: The world is turned where the camera stands more than this off its side in training, radians.
        table: Search for the table where the camera's pose is unknown.
        stated: Search for the table where the pose was given.
        tilt: A table tilted more than this against the stated pose is warned of, radians.
        height: So is one this far off its stated height, metres.
        refine_pose: Correct such a pose by the table seen.
        doubt: When an image is not of one object that stands on an empty table.
    """

    alignment: float = 0.35
    table: TableConfig = field(default_factory=TableConfig)
    stated: TableConfig = field(default_factory=lambda: TableConfig(stride=8, hypotheses=64))
    tilt: float = 0.0175
    height: float = 0.01
    refine_pose: bool = False
    doubt: DoubtConfig = field(default_factory=DoubtConfig)

    def __post_init__(self) -> None:
        if not min(self.alignment, self.tilt, self.height) >= 0:
            raise InvalidConfigurationError(
                f"alignment, tilt (rad) and height (m) must be at least 0, got {self.alignment}, {self.tilt} and "
                f"{self.height}"
            )


@dataclass(frozen=True)
class Observed:
    """What was made of one image.

    Attributes:
        image: What the network sees, metres.
        surface: The measured points, in the workspace frame.
        camera_to_world: Pose of the user's camera, given or found.
        workspace_to_world: Frame in which the network is evaluated: the world turned about z until the camera stands
            where it stood in training.
        problem: Why nothing can be planned, in words; None where something can.
        unfamiliarity: Distance from the training images over the largest one that counts as familiar: above 1 the
            image is unlike the training images. None where the model does not know its training images.
        warnings: What to know before trusting a plan, in words.
    """

    image: Float32[np.ndarray, "height width"]
    surface: Surface
    camera_to_world: Pose
    workspace_to_world: Pose
    problem: str | None
    unfamiliarity: float | None
    warnings: tuple[str, ...]

    @property
    def familiar(self) -> bool:
        """False where the image is known to be unlike the training images."""
        return self.unfamiliarity is None or self.unfamiliarity <= 1.0

    def in_world(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Points of the workspace frame in the world frame, metres."""
        moved: np.ndarray = points @ self.workspace_to_world[:3, :3].T + self.workspace_to_world[:3, 3]
        return moved


class Stopwatch:
    """Wall-clock times of stages, milliseconds."""

    def __init__(self) -> None:
        self.timings: dict[str, float] = {}
        self._started = time.perf_counter()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time of what runs inside to that of the stage."""
        started = time.perf_counter()
        yield
        self.timings[name] = self.timings.get(name, 0.0) + 1e3 * (time.perf_counter() - started)

    def stop(self) -> dict[str, float]:
        """The times of all stages, and `total` since the beginning."""
        return self.timings | {"total": 1e3 * (time.perf_counter() - self._started)}


@dataclass(frozen=True)
class Observer:
    """Reads images.

    Attributes:
        view: Re-projection into the canonical view.
        reader: Points of that view.
        familiarity: What training images look like; None if the model does not say.
        config: Where the workspace is put.
    """

    view: View
    reader: SurfaceReader
    familiarity: Familiarity | None = None
    config: ObserverConfig = field(default_factory=ObserverConfig)

    def observe(
        self, depth: Float32[np.ndarray, "h w"], camera: Camera, rng: np.random.Generator, watch: Stopwatch
    ) -> Observed:
        """Read one image.

        Args:
            depth: Metres, 0 = no return.
            camera: Its camera, with or without a pose.
            rng: Of the search for the table.
            watch: Where the times of the stages go.

        Raises:
            DepthImageError: The depths do not fit the camera's pose, or no table is found.
        """
        warnings: list[str] = []
        with watch.stage("view"):
            camera = self._with_pose(depth, camera, rng, warnings)
            check_scale(depth, camera)
            workspace_to_world = aligned_workspace(camera.pose, self.config.alignment)
            image = self.view(depth, camera.with_pose(np.linalg.inv(workspace_to_world) @ camera.pose))
        with watch.stage("scene"):
            surface = self.reader.read(image)
            problem = surface.problem()
            cleared = self.reader.cleared(image, surface)
            seen = surface if cleared is image else self.reader.read(cleared, surface.item)
            if problem is None:
                warnings += doubts(surface, camera.pose, self.config.doubt)
            unfamiliarity = None if problem else self._unfamiliarity(seen, warnings)
        frames = camera.pose, workspace_to_world
        return Observed(cleared, surface, *frames, problem, unfamiliarity, tuple(warnings))

    def _with_pose(
        self, depth: Float32[np.ndarray, "h w"], camera: Camera, rng: np.random.Generator, warnings: list[str]
    ) -> Camera:
        if camera.camera_to_world is not None:
            return self._doubted(depth, camera, warnings)
        warnings.append(
            "camera_to_world was not given: the world frame is the one found in the image, with its origin on the "
            "table below the object and x towards the camera's side; joint paths hold only if the arm stands in it as "
            "in training"
        )
        return camera.with_pose(locate_workspace(depth, camera, rng, self.config.table))

    def _doubted(self, depth: Float32[np.ndarray, "h w"], camera: Camera, warnings: list[str]) -> Camera:
        """The camera, its stated pose compared with the table seen, and corrected where that is wanted."""
        # The same planes are tried whatever the seed of the plan: whether a pose is right is no matter of chance.
        seen = see_table(depth, camera, generator(0, Stream.STATED_POSE), self.config.stated)
        if seen is None:
            warnings.append(
                "no table is seen where the camera's stated pose puts it, as far as "
                f"{np.degrees(self.config.stated.largest_tilt):.0f} degrees and "
                f"{100 * self.config.stated.largest_shift:.0f} cm around it: plans may be far off"
            )
            return camera
        if seen.tilt <= self.config.tilt and abs(seen.height) <= self.config.height:
            return camera
        if not self.config.refine_pose:
            warnings.append(
                f"the table is {seen} than the camera's stated pose says: plans may miss; measure the pose again, or "
                "let tilt and height be corrected (--refine-pose)"
            )
            return camera
        warnings.append(
            f"the camera's stated pose was corrected, since the table is {seen} than it says; a turn about the "
            "vertical and a shift along the table cannot be seen and were not corrected"
        )
        return camera.with_pose(seen.camera_to_world)

    def _unfamiliarity(self, surface: Surface, warnings: list[str]) -> float | None:
        if self.familiarity is None:
            return None
        score = self.familiarity.distance(surface) / self.familiarity.threshold
        if score > 1:
            warnings.append(
                f"the image is unlike the training images (score {score:.1f}, above 1 is unfamiliar): "
                f"{self.familiarity.strangest(surface)}"
            )
        return score
