"""From priors and simulators to the records of one chunk; the only file that knows both.

A chunk is a number of object draws. Each draw has its own random streams, so a chunk's content depends on the seed, its
number and, for an adaptive proposal, on complete earlier rounds; never on who computes it or when.

Why several attempts and several scenes for each drawn object: an image costs about as much as a few prior attempts,
and a pair of an image and a hand needs both on the same mesh and scale. With A attempts and M scenes a draw, every
attempt can serve every scene (`pairing`): A * M pairs from A lift tests and M images, each pair with the law of a
fresh one. Pairs of one draw share the mesh and beta, which is one number in [0.9, 1.1]; pose, hand, nuisances, camera
and noise differ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np
from jaxtyping import Float32, UInt8

from bayesgrasp.data.images import to_units
from bayesgrasp.data.schema import AttemptRecords, HandRecords, SceneRecords
from bayesgrasp.data.shards import Chunk
from bayesgrasp.depth.any_camera import AnySensor
from bayesgrasp.depth.kinect import KinectConfig
from bayesgrasp.depth.stereo import StereoConfig
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.pairing import DrawPairing, PairingConfig
from bayesgrasp.generation.proposal import AdaptiveConfig, Proposal, propose
from bayesgrasp.geometry.camera import IMAGE_SHAPE
from bayesgrasp.geometry.hand_arrays import attempts_of
from bayesgrasp.lift.lift_config import LiftTestConfig
from bayesgrasp.lift.lift_test import LiftTest, Verdicts
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.prior.cameras import AnyCamera
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.nuisance import CameraPrior, NuisancePrior
from bayesgrasp.prior.planar_symmetry import PlanarRefresh, Reachable
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.motion import reached
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Attempts, CameraNuisances, Scenes

Render = Callable[[Scenes, CameraNuisances, np.random.Generator], Float32[np.ndarray, "n 160 256"]]
"""The sensor generative model, preprocessed: noisy depth of n scenes in metres, 0 = no return."""


@dataclass(frozen=True)
class World:
    """The simulators that a worker holds.

    Attributes:
        lift_test: Outcome of each attempt, and whether it held.
        render: Images of scenes.
        reachable: What the arm can do; None for a hand without an arm.
    """

    lift_test: Callable[[Attempts], Verdicts]
    render: Render
    reachable: Reachable | None = None


@dataclass(frozen=True)
class SimulatedWorld:
    """Builds the real simulators; small enough to be sent to a worker.

    Attributes:
        objects: The ordered object set.
        lift_test: See `LiftTestConfig`.
        sensor, stereo: Constants of the cameras; only cameras anywhere (`prior.cameras`) are stereo ones.
        gripper: The hand.
    """

    objects: tuple[ObjectAsset, ...]
    lift_test: LiftTestConfig = field(default_factory=LiftTestConfig)
    sensor: KinectConfig = field(default_factory=KinectConfig)
    stereo: StereoConfig = field(default_factory=StereoConfig)
    gripper: GripperDescription = field(default_factory=robotiq_3f)

    def build(self) -> World:
        """Build them; a worker does this once."""
        test = LiftTest(self.objects, self.lift_test, gripper=self.gripper)
        sensor = AnySensor(self.objects, self.sensor, self.stereo)
        return World(test.judge, sensor.images, partial(reached, test.arm, self.lift_test.motion))


@dataclass(frozen=True)
class GenerateConfig:
    """What is drawn and how much of it; with the seed, the objects and the simulators it fixes every record.

    Attributes:
        proposal: "prior" draws hands and objects from the prior, "adaptive" also near earlier successes; `docs/data.md`
            compares what a second of simulation gives.
        attempts_per_draw: A, attempts for each drawn (mesh, beta).
        scenes_per_draw: M, images for each.
        draws_per_chunk: Draws in a unit of work.
        adaptive: See `AdaptiveConfig`.
        pairing: See `PairingConfig`.
        grasp, nuisance, camera: The priors.

    Raises:
        InvalidConfigurationError: A count below its least value.
    """

    proposal: Literal["prior", "adaptive"] = "prior"
    attempts_per_draw: int = 256
    scenes_per_draw: int = 8
    draws_per_chunk: int = 16
    adaptive: AdaptiveConfig = field(default_factory=AdaptiveConfig)
    pairing: PairingConfig = field(default_factory=PairingConfig)
    grasp: GraspPrior = field(default_factory=GraspPrior)
    nuisance: NuisancePrior = field(default_factory=NuisancePrior)
    camera: CameraPrior | AnyCamera = field(default_factory=CameraPrior)

    def __post_init__(self) -> None:
        if self.proposal not in ("prior", "adaptive"):
            raise InvalidConfigurationError(f"proposal must be 'prior' or 'adaptive', got {self.proposal!r}")
        if min(self.attempts_per_draw, self.draws_per_chunk) < 1 or self.scenes_per_draw < 0:
            raise InvalidConfigurationError(
                "attempts_per_draw and draws_per_chunk must be at least 1 and scenes_per_draw at least 0, got "
                f"{self.attempts_per_draw}, {self.draws_per_chunk} and {self.scenes_per_draw}"
            )

    @property
    def attempts_per_chunk(self) -> int:
        """Attempts in a full chunk."""
        return self.attempts_per_draw * self.draws_per_chunk


class ChunkMaker:
    """Makes chunks: the same chunk for the same seed, number and proposal, on any machine.

    Args:
        world: The simulators.
        config: See `GenerateConfig`.
        seed: Of the data set.
        scene: p(O) p(p_O), with as many objects as the simulators hold.
    """

    def __init__(self, world: World, config: GenerateConfig, seed: int, scene: ScenePrior) -> None:
        self.world, self.config, self.seed, self.scene = world, config, seed, scene
        self.refresh = PlanarRefresh(config.grasp, scene, world.reachable)

    def make(self, chunk: int, rows: int, proposal: Proposal) -> Chunk:
        """The first ``rows`` attempts of a chunk, simulated, and the scenes of their draws."""
        attempts = self.propose(chunk, rows, proposal)
        attempts = replace(attempts, **labels(self.world.lift_test(attempts)))
        scenes, hands = self._scenes(chunk, attempts)
        return Chunk(attempts, scenes, hands)

    def propose(self, chunk: int, rows: int, proposal: Proposal) -> AttemptRecords:
        """The first ``rows`` attempts of a chunk, not simulated yet (their outcome is 0)."""
        size = self.config.attempts_per_draw
        draws = range(-(-rows // size))
        return AttemptRecords.cat([self._draw(chunk, draw, proposal) for draw in draws])[:rows]

    def _draw(self, chunk: int, draw: int, proposal: Proposal) -> AttemptRecords:
        rng = generator(self.seed, Stream.ATTEMPT, chunk, draw)
        size = self.config.attempts_per_draw
        index = int(rng.choice(self.scene.num_objects, p=proposal.objects))
        scale = self.scene.sample(1, rng).scale
        attempts = self._prior_attempts(index, scale, size, rng)
        log_weight = np.zeros(size)
        if self.config.proposal == "adaptive":
            kernels = proposal.kernels[index]
            attempts, log_weight = propose(attempts, kernels, self.config.grasp, self.config.adaptive, rng)
        object_log_weight = np.log(self.scene.probabilities[index]) - np.log(proposal.objects[index])
        return AttemptRecords(
            **attempts.columns(),
            draw=np.full(size, chunk * self.config.draws_per_chunk + draw, np.int64),
            outcome=np.zeros(size, np.uint8),
            held=np.zeros(size, np.uint8),
            log_weight=log_weight.astype(np.float32),
            object_log_weight=np.full(size, object_log_weight, np.float32),
        )

    def _prior_attempts(
        self, index: int, scale: Float32[np.ndarray, "1"], size: int, rng: np.random.Generator
    ) -> Attempts:
        hands = self.config.grasp.sample(size, rng)
        scenes = Scenes(np.full(size, index, np.int32), np.repeat(scale, size), self.scene.sample_pose(size, rng))
        return attempts_of(hands, scenes, self.config.nuisance.sample(size, rng))

    def _scenes(self, chunk: int, attempts: AttemptRecords) -> tuple[SceneRecords, HandRecords]:
        scenes, cameras, hands = [], [], []
        for draw in np.unique(attempts.draw):
            rng = generator(self.seed, Stream.SCENE, chunk, int(draw) % self.config.draws_per_chunk)
            members = attempts[attempts.draw == draw]
            poses = self.scene.sample_pose(self.config.scenes_per_draw, rng)
            cameras.append(self.config.camera.sample(len(poses), rng))
            first = np.zeros(len(poses), dtype=np.int64)
            scenes.append(Scenes(members.object_index[first], members.scale[first], poses))
            pairing = DrawPairing(members, self.refresh, self.config.pairing)
            hands += [pairing.choose(pose.astype(np.float64), rng) for pose in poses]
        where, camera = Scenes.cat(scenes), type(cameras[0]).cat(cameras)
        draws = np.repeat(np.unique(attempts.draw), self.config.scenes_per_draw)
        return self._records(where, camera, draws, chunk), HandRecords.cat(
            [HandRecords.none(self.config.pairing.hands), *hands]
        )

    def _records(self, scenes: Scenes, camera: CameraNuisances, draws: np.ndarray, chunk: int) -> SceneRecords:
        rng = generator(self.seed, Stream.SENSOR, chunk)
        image = np.zeros((0, *IMAGE_SHAPE), np.float32)
        if len(scenes):
            image = self.world.render(scenes, camera, rng)
        columns = {f"camera_{name}": column for name, column in camera.actual.columns().items()}
        return SceneRecords(**scenes.columns(), draw=draws, **columns, image=to_units(image))


def labels(verdicts: Verdicts) -> dict[str, UInt8[np.ndarray, "n"]]:
    """Verdicts as columns of records."""
    return {"outcome": verdicts.outcomes, "held": verdicts.held.astype(np.uint8)}
