"""``bayesgrasp generate``: simulate a data set of attempts, scenes and images."""

from __future__ import annotations

import importlib.util
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from bayesgrasp.cli.object_set import Objects, ObjectSet
from bayesgrasp.cli.progress import generating
from bayesgrasp.data.manifest import Manifest
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.chunks import GenerateConfig
from bayesgrasp.generation.pairing import PairingConfig
from bayesgrasp.generation.pool import Executor, LocalPool
from bayesgrasp.generation.proposal import AdaptiveConfig
from bayesgrasp.prior.cameras import CameraLaw, camera_law
from bayesgrasp.workflows.generate import GenerateJob
from bayesgrasp.workflows.generate import generate as run


@dataclass(frozen=True)
class Running:
    """How it is computed; the records do not depend on it.

    Attributes:
        workers: Processes on this machine, or, with Ray, chunks under way; 0 for as many as there are cores.
        executor: local, or ray (needs the extra `bayesgrasp[ray]`).
        ray_address: Address of a running Ray cluster; by default one is started on this machine.
        resume: Go on with the data set in --out, or start it where there is none.
        repair: With --resume, make damaged chunks again instead of refusing to go on.
    """

    workers: int = 0
    executor: Literal["local", "ray"] = "local"
    ray_address: str | None = None
    resume: bool = False
    repair: bool = False

    def start(self) -> Executor:
        """What runs the tasks."""
        if self.executor == "local":
            if self.ray_address is not None:
                raise InvalidConfigurationError("--ray-address goes with --executor ray")
            return LocalPool(self.workers or os.cpu_count() or 1)
        if importlib.util.find_spec("ray") is None:
            raise InvalidConfigurationError("--executor ray needs Ray: pip install 'bayesgrasp[ray]'")
        from bayesgrasp.generation.ray_pool import RayPool  # needs Ray

        return RayPool(self.ray_address, self.workers)


@dataclass(frozen=True)
class Drawn:
    """What is drawn, and how much of it.

    Attributes:
        proposal: Where hands are tried: prior, or adaptive (also near earlier successes, with exact weights).
        prior_share: With adaptive, the share of hands from the prior; weights are at most its inverse.
        attempts_per_draw: Attempts for each drawn mesh and scale.
        scenes_per_draw: Images for each drawn mesh and scale; 0 for attempts alone.
        draws_per_chunk: Draws in a unit of work, which is two files; raise it for sets of 10^8 attempts and more.
        hands: Hands kept for each image.
    """

    proposal: Literal["prior", "adaptive"] = "prior"
    prior_share: float = 0.5
    attempts_per_draw: int = 256
    scenes_per_draw: int = 8
    draws_per_chunk: int = 16
    hands: int = 32

    def config(self, cameras: CameraLaw) -> GenerateConfig:
        """The same for the workflow."""
        return GenerateConfig(
            proposal=self.proposal,
            attempts_per_draw=self.attempts_per_draw,
            scenes_per_draw=self.scenes_per_draw,
            draws_per_chunk=self.draws_per_chunk,
            adaptive=AdaptiveConfig(prior_share=self.prior_share),
            pairing=PairingConfig(hands=self.hands),
            camera=camera_law(cameras),
        )


def generate(
    attempts: int,
    out: Path,
    seed: int = 0,
    objects: Objects = ObjectSet(),  # noqa: B008 - frozen
    cameras: CameraLaw = "canonical",
    drawn: Annotated[Drawn, tyro.conf.OmitArgPrefixes] = Drawn(),
    running: Annotated[Running, tyro.conf.OmitArgPrefixes] = Running(),
) -> None:
    """Simulate lift tests and depth images, and keep them for training.

    A run that was interrupted goes on with --resume and ends with the records of an undisturbed run. The records
    depend on the seed, the objects, the cameras and what is drawn, not on how it is computed or interrupted. More
    attempts can be added to a data set by resuming it with a larger number.

    Args:
        attempts: How many lift tests the data set shall have.
        out: Directory of the data set.
        seed: Of all random numbers.
        objects: Which objects.
        cameras: Where images are taken from: by the canonical camera, or by any, 10 to 90 degrees above the horizon,
            0.4 to 1.5 m away, of either make of sensor.
        drawn: What is drawn, and how much of it.
        running: How it is computed.
    """
    executor = running.start()
    job = GenerateJob(objects.load(), attempts, drawn.config(cameras), seed)
    with generating(attempts) as progress:
        manifest = run(job, out, executor, resume=running.resume, repair=running.repair, progress=progress)
    print_data(manifest, out)


def print_data(manifest: Manifest, out: Path) -> None:
    """Say what a finished data set holds."""
    totals = manifest.totals
    share = totals["outcomes"]["success"] / totals["attempts"]
    print(f"{totals['attempts']} attempts, {totals['outcomes']['success']} successes ({share:.2%}),", end=" ")
    print(f"{totals['scenes']} images in {out}")
    print("outcomes: " + ", ".join(f"{name} {count}" for name, count in totals["outcomes"].items()))
