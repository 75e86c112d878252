"""What a data set holds: attempts, scenes with the hands that belong to them, and the batches made of them.

An **object draw** is one O = (mesh, beta), drawn once and tried many times. Its attempts differ in h, p_O and the
nuisances; its scenes differ in p_O and the camera. Every hand of a scene is an attempt of the same draw, moved into the
scene's pose (`prior.planar_symmetry`), so it was simulated on exactly the object that the image shows.

Two weights go with a hand, for two uses (`generation.pairing`):

* ``weight`` makes the hands of all scenes stand for p(h, O, p_O) p(S | h, O, p_O): what a ratio needs, trained on
  densities, such as r(i | S = 1, h);
* ``selection_weight`` undoes only the choice of hands by their outcome. It is enough for p(S = 1 | i, h), which is the
  same whatever law the (i, h) come from, and varies less.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from jaxtyping import Float32, Int, Int32, Int64, UInt8, UInt16
from torch import Tensor

from bayesgrasp.types import Attempts, Columns, Hands, Outcome, Scenes

SCHEMA_VERSION = 3
DEPTH_UNIT = 1e-4
"""Metres per unit of a stored image: tenths of a millimetre, so that 1 m fits 16 bits; 0 = no return."""


@dataclass(frozen=True)
class AttemptRecords(Attempts):
    """Attempts with how they ended and what they stand for.

    Attributes:
        draw: Number of the object draw, the same in `SceneRecords`.
        outcome: `Outcome` values.
        held: 1 where the grasp lifted the object and held it against pushes, 0 elsewhere.
        log_weight: Logarithm of p(h) / q(h | O, p_O), where q is the law that the hand was drawn from.
        object_log_weight: Logarithm of p(O) / q(O), the same for all attempts of a draw.
    """

    draw: Int64[np.ndarray, "n"]
    outcome: UInt8[np.ndarray, "n"]
    held: UInt8[np.ndarray, "n"]
    log_weight: Float32[np.ndarray, "n"]
    object_log_weight: Float32[np.ndarray, "n"]


@dataclass(frozen=True)
class HandRecords(Columns):
    """K hands for each of n scenes, in the world frame of the scene.

    Attributes:
        position: Palm origin, metres.
        quaternion: hand_to_world rotation, (w, x, y, z).
        grasp_type: `GraspType` values.
        outcome: `Outcome` of the attempt, in the scene's pose.
        held: 1 where it also held against pushes.
        weight: See the module; 0 for padding, mean 1 over a data set.
        selection_weight: See the module; 0 for padding.
        lateral_friction, spinning_friction, mass_factor: See `Nuisances`; those of the attempt.
        source: Number of the attempt inside its draw; -1 for padding.
    """

    position: Float32[np.ndarray, "n k 3"]
    quaternion: Float32[np.ndarray, "n k 4"]
    grasp_type: UInt8[np.ndarray, "n k"]
    outcome: UInt8[np.ndarray, "n k"]
    held: UInt8[np.ndarray, "n k"]
    weight: Float32[np.ndarray, "n k"]
    selection_weight: Float32[np.ndarray, "n k"]
    lateral_friction: Float32[np.ndarray, "n k"]
    spinning_friction: Float32[np.ndarray, "n k"]
    mass_factor: Float32[np.ndarray, "n k"]
    source: Int32[np.ndarray, "n k"]

    @staticmethod
    def none(hands: int) -> HandRecords:
        """The hands of no scene, ``hands`` of them for each."""
        numbers, small = np.zeros((0, hands), np.float32), np.zeros((0, hands), np.uint8)
        return HandRecords(
            position=np.zeros((0, hands, 3), np.float32),
            quaternion=np.zeros((0, hands, 4), np.float32),
            grasp_type=small,
            outcome=small,
            held=small,
            weight=numbers,
            selection_weight=numbers,
            lateral_friction=numbers,
            spinning_friction=numbers,
            mass_factor=numbers,
            source=np.zeros((0, hands), np.int32),
        )


@dataclass(frozen=True)
class SceneRecords(Scenes):
    """Scenes with their image and the camera that took it.

    Attributes:
        draw: Number of the object draw.
        camera_position_offset, camera_rotation_vector, camera_near, camera_far, camera_field_of_view_factor:
            See `CameraNuisances`.
        image: Noisy depth after preprocessing, in units of `DEPTH_UNIT`; 0 = no return.
    """

    draw: Int64[np.ndarray, "n"]
    camera_position_offset: Float32[np.ndarray, "n 3"]
    camera_rotation_vector: Float32[np.ndarray, "n 3"]
    camera_near: Float32[np.ndarray, "n"]
    camera_far: Float32[np.ndarray, "n"]
    camera_field_of_view_factor: Float32[np.ndarray, "n"]
    image: UInt16[np.ndarray, "n 160 256"]


@dataclass(frozen=True)
class Batch:
    """B scenes with K hands each, on one device: what every estimator is trained on.

    One encoding of an image is shared by its K hands, since the convolutions cost a thousand times more than the head.

    Attributes:
        hands: Hands in the world frame, batch shape (B, K).
        success: S, 0 or 1.
        weight, selection_weight: See the module.
        images: Depth in metres, 0 = no return; attempts without an image have images of no pixels.
        object_index: Index into the object set of the data set.
        scale: beta.
        object_pose: (x, y, yaw) of the object in the world frame; metres, radians.
        friction: Lateral friction coefficient of each attempt.
        held: Whether the grasp also held against pushes, 0 or 1.
    """

    hands: Hands
    success: Float32[Tensor, "b k"]
    weight: Float32[Tensor, "b k"]
    selection_weight: Float32[Tensor, "b k"]
    images: Float32[Tensor, "b 1 height width"]
    object_index: Int[Tensor, "b"]
    scale: Float32[Tensor, "b"]
    object_pose: Float32[Tensor, "b 3"]
    friction: Float32[Tensor, "b k"]
    held: Float32[Tensor, "b k"]

    def __getitem__(self, index: Tensor | slice) -> Batch:
        """Some of the scenes."""
        return Batch(*(getattr(self, field.name)[index] for field in fields(self)))

    def reweighted(self, factor: Float32[Tensor, "b k"]) -> Batch:
        """The same hands, both of their weights multiplied."""
        return replace(self, weight=self.weight * factor, selection_weight=self.selection_weight * factor)

    def to(self, device: torch.device | str) -> Batch:
        """The same scenes on another device."""
        return Batch(*(getattr(self, field.name).to(device) for field in fields(self)))


def success_of(outcome: UInt8[np.ndarray, "*shape"]) -> Float32[Tensor, "*shape"]:
    """S as float32: 1 for SUCCESS, 0 for every other outcome."""
    return torch.from_numpy((outcome == Outcome.SUCCESS).astype(np.float32))
