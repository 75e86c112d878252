"""What a plan is: ranked grasps, or the reason why there are none."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from bayesgrasp.planning.constraints import Constraints
from bayesgrasp.planning.observing import Observed, Pose
from bayesgrasp.posterior.posterior import Posterior
from bayesgrasp.posterior.sampling import PosteriorSample
from bayesgrasp.robot.motion import Motion
from bayesgrasp.types import GraspType


@dataclass(frozen=True)
class Grasp:
    """One grasp that the arm can reach.

    Attributes:
        hand_to_world: Pose of the hand, metres.
        hand_to_camera: The same in the frame of the user's camera.
        grasp_type: Grasp type.
        log_posterior: log p(h | S=1, i), nats, as `Posterior.log_prob` gives it.
        success_probability: Estimate of p(S=1 | i, h); NaN where the model does not know it.
        on_object: Share of the measured object points that lie between the fingers.
        clearance: Least distance of the open hand, on its straight way to h, from the measured points above the
            table, metres; slightly negative within the sensor's noise.
        motion: Joint angles of the arm.
        held_probability: Estimate of p(held | i, h), that the object is also held against pushes; NaN where the model
            does not know it.
    """

    hand_to_world: Pose
    hand_to_camera: Pose
    grasp_type: GraspType
    log_posterior: float
    success_probability: float
    on_object: float
    clearance: float
    motion: Motion
    held_probability: float = math.nan

    @property
    def chance(self) -> str:
        """The success probability in words, and where it is known that of holding against pushes."""
        if not np.isfinite(self.success_probability):
            return "success probability unknown"
        held = f", held {100 * self.held_probability:.0f} %" if np.isfinite(self.held_probability) else ""
        return f"estimated success {100 * self.success_probability:.0f} %{held}"

    def to_dict(self) -> dict[str, Any]:
        """As plain data under the attributes' names; metres, radians, quaternions (w, x, y, z), null for no number."""
        return {
            "hand_to_world": _pose_to_dict(self.hand_to_world),
            "hand_to_camera": _pose_to_dict(self.hand_to_camera),
            "grasp_type": self.grasp_type.name.lower(),
            "log_posterior": self.log_posterior,
            "success_probability": _finite(self.success_probability),
            "held_probability": _finite(self.held_probability),
            "on_object": self.on_object,
            "clearance": _finite(self.clearance),
            "motion": {name: getattr(self.motion, name).tolist() for name in ("transit", "approach", "lift")},
        }


@dataclass(frozen=True)
class Plan:
    """The answer to one image.

    Attributes:
        grasps: Ranked, best first.
        reason: Why there is none, in words; None where there is one.
        observed: What was made of the image: frames, measured points, familiarity.
        constraints: What the grasps had to keep to.
        posterior: p(h | S=1, i), world frame; None where there is nothing to grasp.
        samples: Draws from it, where asked for.
        timings_ms: Wall-clock time of each stage, and `total`.
    """

    grasps: tuple[Grasp, ...]
    reason: str | None
    observed: Observed
    constraints: Constraints
    posterior: Posterior | None
    samples: PosteriorSample | None
    timings_ms: dict[str, float]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before trusting the grasps, in words."""
        return self.observed.warnings

    def to_dict(self) -> dict[str, Any]:
        """As plain data under the attributes' names; with `constraints` where there were any."""
        return {
            "grasps": [grasp.to_dict() for grasp in self.grasps],
            "reason": self.reason,
            "warnings": list(self.warnings),
            "observed": _observed_to_dict(self.observed),
            "samples": _sample_to_dict(self.samples),
            "timings_ms": self.timings_ms,
            **({"constraints": self.constraints.to_dict()} if self.constraints.any else {}),
        }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _pose_to_dict(pose: Pose) -> dict[str, Any]:
    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True, scalar_first=True)
    return {"position": pose[:3, 3].tolist(), "rotation": pose[:3, :3].tolist(), "quaternion": quaternion.tolist()}


def _observed_to_dict(observed: Observed) -> dict[str, Any]:
    return {
        "camera_to_world": observed.camera_to_world.tolist(),
        "unfamiliarity": observed.unfamiliarity,
        "familiar": observed.familiar,
    }


def _sample_to_dict(samples: PosteriorSample | None) -> dict[str, Any] | None:
    """How many draws there are and how good; `posterior.samples_file` writes the draws themselves."""
    if samples is None:
        return None
    quality = {name: getattr(samples, name) for name in ("effective_sample_size", "acceptance", "jump_acceptance")}
    return {"hands": len(samples.hands.grasp_type), "evidence": asdict(samples.evidence)} | quality
