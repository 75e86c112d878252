"""What a plan is: ranked grasps, or the reason why there are none."""

from __future__ import annotations

import math
from dataclasses import dataclass
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
        """As plain data; metres, radians, quaternions (w, x, y, z)."""
        return {
            **_pose_to_dict(self.hand_to_world),
            "grasp_type": self.grasp_type.name.lower(),
            "log_posterior": self.log_posterior,
            "success_probability": self.success_probability if np.isfinite(self.success_probability) else None,
            "held_probability": self.held_probability if np.isfinite(self.held_probability) else None,
            "object_between_fingers": self.on_object,
            "clearance": self.clearance if np.isfinite(self.clearance) else None,
            "in_camera_frame": _pose_to_dict(self.hand_to_camera),
            "joint_path": self._phases(),
        }

    def _phases(self) -> list[dict[str, Any]]:
        """The joint path by phase; closing moves the fingers only."""
        motion = self.motion
        angles = {"pre_grasp": motion.transit, "approach": motion.approach, "close": motion.approach[-1:]}
        return [{"phase": name, "joints": path.tolist()} for name, path in (angles | {"lift": motion.lift}).items()]


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
        """As plain data; with `constraints` where there were any."""
        return {
            "grasps": [grasp.to_dict() for grasp in self.grasps],
            "reason": self.reason,
            "warnings": list(self.warnings),
            "misspecification": {"score": self.observed.unfamiliarity, "unfamiliar": not self.observed.familiar},
            "camera_to_world": self.observed.camera_to_world.tolist(),
            "posterior": _sample_to_dict(self.samples),
            "timings_ms": self.timings_ms,
            **({"constraints": self.constraints.to_dict()} if self.constraints.any else {}),
        }


def _pose_to_dict(pose: Pose) -> dict[str, Any]:
    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True, scalar_first=True)
    return {"position": pose[:3, 3].tolist(), "rotation": pose[:3, :3].tolist(), "quaternion": quaternion.tolist()}


def _sample_to_dict(samples: PosteriorSample | None) -> dict[str, Any] | None:
    if samples is None:
        return None
    names = ("effective_sample_size", "acceptance", "jump_acceptance")
    content = {"samples": len(samples.hands.grasp_type), "log_mean_ratio": samples.evidence.log_mean}
    return content | {name: getattr(samples, name) for name in names}
