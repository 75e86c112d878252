"""What every strategy faces: scene i with its nuisances and its depth image, the same for all of them.

Scene i uses a random stream of its own below the seed and nothing else. Objects take turns, so that each has the
same number of scenes (to one): under the paper's uniform prior of meshes that is the same expectation as drawing them,
with less variance. Scale, pose, frictions, mass, camera and sensor noise are drawn from their priors (section 4.1). A
shift (`shifts`) is applied to what was drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import Float32, Float64

from bayesgrasp.depth.any_camera import stated_camera
from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.shifts import NONE, Shift
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.geometry.hand_arrays import attempts_of
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.observation.canonical_view import CanonicalView
from bayesgrasp.observation.preprocess import preprocess
from bayesgrasp.observation.user_camera import aligned_workspace
from bayesgrasp.planning.observing import ObserverConfig
from bayesgrasp.prior.cameras import AnyCamera
from bayesgrasp.prior.nuisance import CameraPrior, NuisancePrior
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Attempts, Hands, Nuisances, Scenes, StatedCameras


@dataclass(frozen=True)
class ScenePriors:
    """Where scenes come from; ``scene.num_objects`` is replaced by the size of the object set in use."""

    scene: ScenePrior = field(default_factory=lambda: ScenePrior(1))
    nuisance: NuisancePrior = field(default_factory=NuisancePrior)
    camera: CameraPrior | AnyCamera = field(default_factory=CameraPrior)


@dataclass(frozen=True)
class Situation:
    """One scene.

    Attributes:
        number: i.
        asset: The object; only strategies with full observation may look at it.
        scene: Object, scale and pose, one row.
        nuisances: Frictions and mass, one row.
        depth: What the camera returned, metres, 0 = no return.
        image: The same as the network's image, in the workspace frame.
        camera: That took it, as its user states it.
    """

    number: int
    asset: ObjectAsset
    scene: Scenes
    nuisances: Nuisances
    depth: Float32[np.ndarray, "480 640"]
    image: Float32[np.ndarray, "160 256"]
    camera: Camera = field(default_factory=canonical_camera)

    @property
    def pose(self) -> tuple[float, float, float]:
        """(x, y, yaw) of the object, metres and radians."""
        x, y, yaw = (float(value) for value in self.scene.object_pose[0])
        return x, y, yaw

    @property
    def workspace_to_world(self) -> Float64[np.ndarray, "4 4"]:
        """The frame of the network's image: the world, turned where the camera stands on another side."""
        return aligned_workspace(self.camera.pose, ObserverConfig.alignment)

    def in_world(self, hands: Hands) -> Hands:
        """Hands of the workspace frame in the world frame."""
        turn = torch.from_numpy(self.workspace_to_world[:3, :3]).to(hands.position.dtype)
        return Hands(hands.position @ turn.mT, turn @ hands.rotation, hands.grasp_type)

    def attempts(self, hands: Hands) -> Attempts:
        """Lift tests of hands of batch shape (n,) in this scene."""
        rows = np.zeros(len(hands.grasp_type), dtype=np.int64)
        return attempts_of(hands, self.scene[rows], self.nuisances[rows])


class SceneMaker:
    """Draws scenes and takes their images.

    Args:
        objects: The object set.
        seed: Of all random numbers.
        priors: The defaults of `prior`.
        shift: How the world departs from them.

    Raises:
        InvalidConfigurationError: No object.
    """

    def __init__(
        self, objects: Sequence[ObjectAsset], seed: int, priors: ScenePriors | None = None, shift: Shift = NONE
    ) -> None:
        if not objects:
            raise InvalidConfigurationError("a benchmark needs at least one object")
        self.objects, self.seed, self.priors = tuple(objects), seed, priors or ScenePriors()
        self.shift = shift
        self.sensor = DepthSensor(self.objects, config=shift.sensor_config)
        self.view = CanonicalView()

    def make(self, number: int) -> Situation:
        """Scene i."""
        rng = generator(self.seed, Stream.BENCHMARK_SCENE, number)
        index = number % len(self.objects)
        drawn = replace(self.priors.scene, num_objects=len(self.objects), weights=None).sample(1, rng)
        scene = self.shift.scenes(replace(drawn, object_index=np.array([index], dtype=np.int32)))
        nuisances = self.shift.nuisances(self.priors.nuisance.sample(1, rng), self.priors.nuisance)
        cameras = self.priors.camera.sample(1, rng)
        depth = self.sensor.render(scene, cameras.actual, rng)[0]
        taken = number, self.objects[index], scene, nuisances, depth
        if not isinstance(cameras, StatedCameras):
            return Situation(*taken, preprocess(depth))
        camera = stated_camera(cameras, 0)
        workspace = aligned_workspace(camera.pose, ObserverConfig.alignment)
        seen_from = camera.with_pose(np.linalg.inv(workspace) @ camera.pose)
        return Situation(*taken, self.view.of(depth, seen_from), camera)
