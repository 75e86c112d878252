"""The experiments of ``bayesgrasp reproduce``: minutes without any data, the paper's, and the model for any object."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from bayesgrasp.objects.deform import DeformConfig
from bayesgrasp.prior.cameras import CameraLaw
from bayesgrasp.ratio.model import Role
from bayesgrasp.training.presets import PresetName
from bayesgrasp.workflows.practise import Practised

ScaleName = Literal["small", "paper", "general"]


@dataclass(frozen=True)
class Round:
    """Practice, and the training that learns from it.

    Attributes:
        estimator: Which one proposes, and is trained further.
        scenes, explore: See `bayesgrasp practice`.
        epochs, learning_rate: Of the further training; it learns from the data and from all practice so far. Without
            epochs the practice is kept for the next round.
        deform: Copies of the objects.
        split: Objects; those of the experiment if None.
    """

    estimator: Practised
    scenes: int
    epochs: int
    learning_rate: float = 5e-4
    deform: DeformConfig = field(default_factory=DeformConfig)
    explore: int = 0
    split: str | None = None


@dataclass(frozen=True)
class Scale:
    """How large an experiment is.

    Attributes:
        split: Training objects.
        attempts: Lift tests of the data set.
        cameras: Where images are taken from.
        proposal, attempts_per_draw, scenes_per_draw: See `bayesgrasp generate`; a small set needs the successes of the
            adaptive proposal, whose weights matter less there.
        draws_per_chunk: See `GenerateConfig`; the first 16 chunks are drawn from the prior, so small chunks are soon
            followed by successes.
        preset, estimators, batch_size, learning_rate: See `bayesgrasp train`.
        epochs: Passes over the training scenes of each estimator; those without an image cost little and need many.
        rounds: Practice after the first training.
        start: Name of a shipped model that is trained further, instead of a first training.
        kept: Share of the start in the weights of the result; see `bayesgrasp mix`.
        truths, proposals: See `bayesgrasp diagnose`.
        scenes: Of each benchmark.
        judged: Splits that are benchmarked.
        demo: The object of the posterior figure.
    """

    split: str
    attempts: int
    proposal: Literal["prior", "adaptive"]
    attempts_per_draw: int
    scenes_per_draw: int
    draws_per_chunk: int
    preset: PresetName
    estimators: tuple[Role, ...]
    epochs: dict[Role, int]
    batch_size: int
    learning_rate: float
    truths: int
    proposals: int
    scenes: int
    judged: tuple[str, ...]
    rounds: tuple[Round, ...] = ()
    cameras: CameraLaw = "canonical"
    start: str | None = None
    kept: float = 0.0
    demo: str = "household_carton"


ANYTHING = "train+procedural:3000@7"
"""The objects of the general model: scans, household stand-ins, and three thousand random things."""
BENT_COPIES = DeformConfig(6, stretch=1.3, taper=0.2, bend=0.3)

SCALES: dict[ScaleName, Scale] = {
    "small": Scale(
        split="stand-ins",
        attempts=8_192,
        proposal="adaptive",
        attempts_per_draw=32,
        scenes_per_draw=3,
        draws_per_chunk=4,
        preset="best",
        estimators=("success_ratio", "success", "full"),
        epochs={"success_ratio": 40, "success": 4, "full": 20},
        batch_size=8,
        learning_rate=2e-3,
        truths=60,
        proposals=1500,
        scenes=40,
        judged=("stand-ins",),
    ),
    "paper": Scale(
        split="train",
        attempts=1_000_000,
        proposal="prior",
        attempts_per_draw=256,
        scenes_per_draw=8,
        draws_per_chunk=16,
        preset="best",
        estimators=("success_ratio", "success", "full"),
        epochs={"success_ratio": 20, "success": 20, "full": 60},
        batch_size=16,
        learning_rate=1e-3,
        truths=1000,
        proposals=10_000,
        scenes=1000,
        judged=("train", "train-ycb", "unseen"),
        rounds=(
            Round("success", scenes=3008, epochs=4, deform=DeformConfig(3)),
            Round("success", scenes=3008, epochs=4, deform=DeformConfig(3)),
            Round("full", scenes=3008, epochs=10),
        ),
    ),
    "general": Scale(
        split=ANYTHING,
        attempts=196_608,
        proposal="prior",
        attempts_per_draw=128,
        scenes_per_draw=8,
        draws_per_chunk=8,
        preset="best",
        estimators=("success",),
        epochs={},
        batch_size=16,
        learning_rate=7e-4,
        truths=1000,
        proposals=10_000,
        scenes=1000,
        judged=("train", "unseen", "procedural:200@77"),
        rounds=(
            Round("success", scenes=1216, epochs=0, deform=BENT_COPIES, explore=12, split="train"),
            Round("success", scenes=3072, epochs=5, learning_rate=7e-4, explore=12),
            Round("success", scenes=1024, epochs=0, deform=BENT_COPIES, explore=3, split="train"),
            Round("success", scenes=4096, epochs=3, explore=3),
        ),
        start="paper",
        kept=0.25,
        cameras="any",
    ),
}
