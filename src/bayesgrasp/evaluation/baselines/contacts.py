"""Where the fingers of a closing hand would first touch a known object, without physics.

The hand stands still and its fingers follow the motion that they make when they close on nothing. Each finger is a set
of balls along its links. It stops where one of its balls first meets a convex part of the object; that ball gives one
contact, with the normal of the part's face that it meets. What this leaves out: the object does not move, a finger does
not wrap around after its first contact, and touches of the palm do not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from bayesgrasp.lift.hand_kinematics import HandKinematics
from bayesgrasp.meshes.convex import ConvexPart
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.types import GraspType

BALLS = 4
"""Balls along each shape of a finger."""
CONTROL_PERIOD = 0.02
"""Of the recorded closing motion, seconds."""


@dataclass(frozen=True)
class ClosingHand:
    """Balls of the fingers while they close on nothing, in the hand frame.

    Attributes:
        centers: Metres, by step of the motion and by ball.
        radii: Metres.
        finger: Which finger each ball belongs to.
    """

    centers: Float64[np.ndarray, "steps balls 3"]
    radii: Float64[np.ndarray, "balls"]
    finger: Int64[np.ndarray, "balls"]


@dataclass(frozen=True)
class Contacts:
    """Where fingers touch, in the object frame at the object's true size.

    Attributes:
        points: Metres.
        normals: Unit vectors, pointing into the object.
        overlap: Whether a finger of the open hand is inside the object already.
    """

    points: Float64[np.ndarray, "contacts 3"]
    normals: Float64[np.ndarray, "contacts 3"]
    overlap: bool


def closing_hand(gripper: GripperDescription, grasp_type: GraspType, steps: int = 24) -> ClosingHand:
    """The closing motion of a grasp type, thinned to about this many steps."""
    kinematics = HandKinematics(gripper)
    path = kinematics.free_closing(grasp_type, CONTROL_PERIOD)
    path = path[np.unique(np.linspace(0, len(path) - 1, steps).astype(int))]
    fingers = _finger_of_link(gripper)
    frames = []
    for angles in path:
        links = kinematics.link_points(angles)
        frames.append([(fingers[name], *_balls(*shape)) for name in fingers for shape in links[name]])
    centers = np.stack([np.concatenate([balls for _, balls, _ in frame]) for frame in frames])
    radii = np.repeat([radius for _, _, radius in frames[0]], BALLS).astype(np.float64)
    finger = np.repeat([number for number, _, _ in frames[0]], BALLS).astype(np.int64)
    return ClosingHand(centers, radii, finger)


def first_contacts(
    hand: ClosingHand, hand_to_object: Float64[np.ndarray, "4 4"], parts: Sequence[ConvexPart], scale: float
) -> Contacts:
    """The first contact of every finger.

    Args:
        hand: The closing hand.
        hand_to_object: Pose of the hand in the object frame, metres.
        parts: Of the object, at scale 1.
        scale: beta.
    """
    centers = hand.centers @ hand_to_object[:3, :3].T + hand_to_object[:3, 3]
    distance, outward = _distance(centers.reshape(-1, 3), parts, scale)
    distance, outward = distance.reshape(centers.shape[:2]), outward.reshape(centers.shape)
    gap = distance - hand.radii
    touching = [hit for finger in np.unique(hand.finger) if (hit := _first(gap, hand.finger == finger)) is not None]
    steps, balls = (np.array(side, dtype=np.int64) for side in zip(*touching, strict=True)) if touching else _NOTHING
    normals = outward[steps, balls]
    points = centers[steps, balls] - distance[steps, balls, None] * normals
    return Contacts(points, -normals, bool((gap[0] < 0).any()))


_NOTHING = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))


def _first(gap: Float64[np.ndarray, "steps balls"], mine: np.ndarray) -> tuple[int, int] | None:
    """Step and ball of a finger's first contact."""
    nearest = np.where(mine, gap, np.inf)
    touched = (nearest <= 0).any(axis=1)
    if not touched.any():
        return None
    step = int(touched.argmax())
    return step, int(nearest[step].argmin())


def _distance(
    points: Float64[np.ndarray, "n 3"], parts: Sequence[ConvexPart], scale: float
) -> tuple[Float64[np.ndarray, "n"], Float64[np.ndarray, "n 3"]]:
    """Signed distance to the nearest part (a lower bound outside, metres) and the outward normal of its face."""
    best, normal = np.full(len(points), np.inf), np.zeros((len(points), 3))
    for part in parts:
        normals, offsets = part.halfspaces()
        heights = points @ normals.T - scale * offsets
        face = heights.argmax(axis=1)
        height = heights[np.arange(len(points)), face]
        nearer = height < best
        best[nearer], normal[nearer] = height[nearer], normals[face[nearer]]
    return best, normal


def _balls(points: Float64[np.ndarray, "n 3"], radius: float) -> tuple[Float64[np.ndarray, "balls 3"], float]:
    """Balls along a capsule (given by its two ends) or along the longest edge of a box (given by its corners)."""
    if len(points) == 2:
        start, end = points
    else:
        edges = points[[4, 2, 1]] - points[0]
        lengths = np.linalg.norm(edges, axis=1)
        longest, radius = int(lengths.argmax()), float(lengths.min()) / 2
        reach = (0.5 - radius / lengths[longest]) * edges[longest]
        start, end = points.mean(axis=0) - reach, points.mean(axis=0) + reach
    fractions = np.linspace(0.0, 1.0, BALLS)[:, None]
    return start + fractions * (end - start), radius


def _finger_of_link(gripper: GripperDescription) -> dict[str, int]:
    """Number of the finger by link, for the links that a motor moves."""
    owner = {joint: number for number, motor in enumerate(gripper.motors) for joint in motor.weights}
    return {link.name: owner[link.joint.name] for link in gripper.links if link.joint and link.joint.name in owner}
