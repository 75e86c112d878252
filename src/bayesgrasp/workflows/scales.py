"""How large the experiment of ``bayesgrasp reproduce`` is: minutes without any data, or the paper's with YCB scans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bayesgrasp.ratio.model import Role
from bayesgrasp.training.presets import PresetName
from bayesgrasp.workflows.practise import Practised

ScaleName = Literal["small", "full"]


@dataclass(frozen=True)
class Round:
    """Practice, and the training that learns from it.

    Attributes:
        estimator: Which one proposes, and is trained further.
        scenes, copies: See `bayesgrasp practice`.
        epochs, learning_rate: Of the further training; it learns from the data and from all practice so far.
    """

    estimator: Practised
    scenes: int
    copies: int
    epochs: int
    learning_rate: float


@dataclass(frozen=True)
class Scale:
    """How large an experiment is.

    Attributes:
        split: Training objects.
        attempts: Lift tests of the data set.
        proposal, attempts_per_draw, scenes_per_draw: See `bayesgrasp generate`; a small set needs the successes of the
            adaptive proposal, whose weights matter less there.
        draws_per_chunk: See `GenerateConfig`; the first 16 chunks are drawn from the prior, so small chunks are soon
            followed by successes.
        preset, estimators, batch_size, learning_rate: See `bayesgrasp train`.
        epochs: Passes over the training scenes of each estimator; those without an image cost little and need many.
        rounds: Practice after the first training.
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
    demo: str = "household_carton"


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
    "full": Scale(
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
            Round("success", scenes=3008, copies=3, epochs=4, learning_rate=5e-4),
            Round("success", scenes=3008, copies=3, epochs=4, learning_rate=5e-4),
            Round("full", scenes=3008, copies=0, epochs=10, learning_rate=5e-4),
        ),
    ),
}
