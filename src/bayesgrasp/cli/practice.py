"""``bayesgrasp practice``: try a model's own proposals, for more training data where they matter."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from bayesgrasp.cli.generate import print_data
from bayesgrasp.cli.object_set import Objects, ObjectSet
from bayesgrasp.cli.progress import generating
from bayesgrasp.objects.deform import DeformConfig
from bayesgrasp.prior.cameras import CameraLaw
from bayesgrasp.workflows.load import model_directory
from bayesgrasp.workflows.practise import PracticeJob, Practised, practise


@dataclass(frozen=True)
class Tried:
    """What is tried.

    Attributes:
        scenes: How many images; for success_ratio, which looks at none, how many scenes of one try each.
        tries: Hands tried for each image, at least 3.
        explore: How many of the tries are hands from above that no model proposes: just over the table or higher, any
            grasp type. All of them, or all but 3 or more.
        estimator: Which estimator proposes: success (it sees the image), full (it knows object, pose and friction) or
            success_ratio (it knows nothing).
        cameras: Where images are taken from, canonical or any; by default as in the data that the model was trained on.
    """

    scenes: int = 2000
    tries: int = 12
    explore: int = 0
    estimator: Practised = "success"
    cameras: CameraLaw | None = None


@dataclass(frozen=True)
class Copies:
    """Deformed copies of the objects.

    Attributes:
        copies: Of each object, practised on beside it, for more shapes than there are scans.
        stretch: Each axis of a copy is multiplied by a factor between 1 / stretch and stretch.
        taper: Widths of a copy change by up to this share between bottom and top.
        bend: A copy is bent by up to so many radians in the plane of the table, as far as its convex parts allow.
    """

    copies: int = 0
    stretch: float = 1.3
    taper: float = 0.0
    bend: float = 0.0


def practice(
    model: Path,
    out: Path,
    objects: Objects = ObjectSet(),  # noqa: B008 - frozen
    tried: Annotated[Tried, tyro.conf.OmitArgPrefixes] = Tried(),
    deformed: Annotated[Copies, tyro.conf.OmitArgPrefixes] = Copies(),
    seed: int = 0,
    workers: int = os.cpu_count() or 1,
    resume: bool = False,
) -> None:
    """Try the hands that a model proposes for new scenes, and keep the outcomes as training data.

    Give the result to `bayesgrasp train` beside the data that the model was trained on: the next model knows where the
    first one was wrong in its own favour. Practice of `success` teaches `success` and `full`, that of `full` only
    `full`, that of `success_ratio`, which knows nothing of a scene, only `success_ratio`.

    Args:
        model: Directory of the model.
        out: Directory of the new data set.
        objects: Which objects; never the unseen ones if they are to stay unseen.
        tried: What is tried.
        deformed: Deformed copies of the objects.
        seed: Of all random numbers.
        workers: Processes.
        resume: Go on with the data set in --out, or start it where there is none.
    """
    copies = DeformConfig(deformed.copies, deformed.stretch, deformed.taper, deformed.bend)
    job = PracticeJob(model_directory(model), objects.load(), **vars(tried), deform=copies, seed=seed)
    with generating(job.attempts) as progress:
        manifest = practise(job, out, workers, resume=resume, progress=progress)
    print_data(manifest, out)
