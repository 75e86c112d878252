"""The variables of the model (paper, section 2): hand configurations, scenes, nuisances, attempts and outcomes.

World frame: origin on the table top at the centre of the workspace, z up; metres, radians, kilograms.
Hand frame: x = approach, y = closing direction, z = x cross y, origin at the palm.
Object frame: the object at rest on the table plane z = 0, origin below its centre of mass, so that a planar pose and a
scale about the origin keep it on the table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any, TypeVar

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Int, Int32, UInt8
from torch import Tensor


class GraspType(IntEnum):
    """Spacing of the two fingers opposite the thumb, in the paper's order."""

    BASIC = 0
    WIDE = 1
    PINCH = 2


class Outcome(IntEnum):
    """How a lift test ended. Every attempt has exactly one outcome; only SUCCESS means S = 1."""

    UNREACHABLE = 0
    COLLISION = 1
    NO_CONTACT = 2
    DROPPED = 3
    SUCCESS = 4
    DIVERGED = 5


UNSTATED_HAND = "2bb59372800730d3d0e200f31669352fc85f090a7d8ad840137f37ee851b3150"
"""SHA-256 of the hand of data sets and models that state only its name: the Robotiq 3-Finger, as it always was."""


@dataclass(frozen=True)
class HandIdentity:
    """Which hand something was made with: the name of its description, and the SHA-256 of all that it says."""

    name: str
    sha256: str = UNSTATED_HAND

    def compare(self, other: HandIdentity) -> str:
        """In words, this hand and not the other one; empty where they are the same."""
        if self == other:
            return ""
        if self.name != other.name:
            return f"the gripper {self.name!r}, not for {other.name!r}"
        return (
            f"the gripper {self.name!r} of description {self.sha256[:8]}, not for {other.name!r} of description "
            f"{other.sha256[:8]}"
        )


@dataclass(frozen=True)
class Hands:
    """A batch of hand configurations h = (x, R, g), for learning and inference (torch).

    Attributes:
        position: Palm origin in the world frame, metres.
        rotation: hand_to_world rotation matrices.
        grasp_type: `GraspType` values, int64.
    """

    position: Float[Tensor, "*batch 3"]
    rotation: Float[Tensor, "*batch 3 3"]
    grasp_type: Int[Tensor, "*batch"]

    @property
    def shape(self) -> torch.Size:
        """Batch shape."""
        return self.grasp_type.shape

    def __getitem__(self, index: object) -> Hands:
        return Hands(self.position[index], self.rotation[index], self.grasp_type[index])  # type: ignore[index]

    def to(self, device: torch.device | str | None = None, dtype: torch.dtype | None = None) -> Hands:
        """The same hands on another device, or with another floating-point type."""
        return Hands(
            self.position.to(device=device, dtype=dtype),
            self.rotation.to(device=device, dtype=dtype),
            self.grasp_type.to(device=device),
        )

    @staticmethod
    def cat(parts: Sequence[Hands]) -> Hands:
        """Concatenate along the first batch dimension."""
        return Hands(
            torch.cat([p.position for p in parts]),
            torch.cat([p.rotation for p in parts]),
            torch.cat([p.grasp_type for p in parts]),
        )


C = TypeVar("C", bound="Columns")


class Columns:
    """Base of frozen dataclasses whose fields are NumPy arrays with one common leading dimension."""

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))  # type: ignore[arg-type]

    def __getitem__(self: C, index: Any) -> C:
        return type(self)(**{name: column[index] for name, column in self.columns().items()})

    def columns(self) -> dict[str, np.ndarray]:
        """The arrays by field name, in order, without copying."""
        return {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]

    @classmethod
    def cat(cls: type[C], parts: Sequence[C]) -> C:
        """Concatenate batches along the leading dimension."""
        return cls(**{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)})  # type: ignore[arg-type]


@dataclass(frozen=True)
class Scenes(Columns):
    """What stands on the table: O = (mesh, beta) and its planar pose p_O.

    Attributes:
        object_index: Index into the ordered object set that the scenes were drawn for.
        scale: beta, applied about the origin of the object frame.
        object_pose: (x, y, yaw) of the object frame in the world frame; metres, radians.
    """

    object_index: Int32[np.ndarray, "n"]
    scale: Float32[np.ndarray, "n"]
    object_pose: Float32[np.ndarray, "n 3"]


@dataclass(frozen=True)
class Nuisances(Columns):
    """Physical nuisances of the lift test.

    Attributes:
        lateral_friction: Coulomb coefficient mu of the object against the hand and the table.
        spinning_friction: Torsional coefficient gamma, metres (MuJoCo's convention).
        mass_factor: True mass divided by (catalogue mass * beta^3).
    """

    lateral_friction: Float32[np.ndarray, "n"]
    spinning_friction: Float32[np.ndarray, "n"]
    mass_factor: Float32[np.ndarray, "n"]


@dataclass(frozen=True)
class CameraNuisances(Columns):
    """Nuisances of the depth sensor, relative to the nominal camera.

    Attributes:
        position_offset: Added to the camera's position in the world frame, metres.
        rotation_vector: eta, radians, in the camera frame: camera_to_world becomes camera_to_world * exp(eta).
        near, far: Range outside which the sensor returns nothing, metres.
        field_of_view_factor: True field of view (angle) divided by the nominal one, both ways.
    """

    position_offset: Float32[np.ndarray, "n 3"]
    rotation_vector: Float32[np.ndarray, "n 3"]
    near: Float32[np.ndarray, "n"]
    far: Float32[np.ndarray, "n"]
    field_of_view_factor: Float32[np.ndarray, "n"]

    @property
    def actual(self) -> CameraNuisances:
        """What the cameras really are, without what is said of them."""
        return CameraNuisances(**{f.name: getattr(self, f.name) for f in fields(CameraNuisances)})


@dataclass(frozen=True)
class StatedCameras(CameraNuisances):
    """Cameras anywhere: what they really are, and what their user states of them, both relative to the canonical one.

    Attributes:
        stated_position_offset, stated_rotation_vector, stated_field_of_view_factor: As of `CameraNuisances`.
        stereo: Whether it is a stereo camera; a structured-light one otherwise.
    """

    stated_position_offset: Float32[np.ndarray, "n 3"]
    stated_rotation_vector: Float32[np.ndarray, "n 3"]
    stated_field_of_view_factor: Float32[np.ndarray, "n"]
    stereo: Bool[np.ndarray, "n"]

    @property
    def stated(self) -> CameraNuisances:
        """What is said of the cameras."""
        return CameraNuisances(
            self.stated_position_offset,
            self.stated_rotation_vector,
            self.near,
            self.far,
            self.stated_field_of_view_factor,
        )


@dataclass(frozen=True)
class Attempts(Columns):
    """Inputs of the lift test, one row an attempt; float32, so that a stored attempt can be repeated bit for bit.

    Attributes:
        position: Palm origin in the world frame, metres.
        quaternion: hand_to_world rotation, (w, x, y, z); normalised by the reader.
        grasp_type: `GraspType` values.
        object_index, scale, object_pose: See `Scenes`.
        lateral_friction, spinning_friction, mass_factor: See `Nuisances`.
    """

    position: Float32[np.ndarray, "n 3"]
    quaternion: Float32[np.ndarray, "n 4"]
    grasp_type: UInt8[np.ndarray, "n"]
    object_index: Int32[np.ndarray, "n"]
    scale: Float32[np.ndarray, "n"]
    object_pose: Float32[np.ndarray, "n 3"]
    lateral_friction: Float32[np.ndarray, "n"]
    spinning_friction: Float32[np.ndarray, "n"]
    mass_factor: Float32[np.ndarray, "n"]
