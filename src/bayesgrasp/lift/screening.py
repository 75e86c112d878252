"""Attempts whose outcome is certain without physics.

Four certainties, each conservative (an attempt that they cannot decide goes on to the next, slower stage):

* the open hand at h reaches below the table plane: COLLISION;
* the open hand at h or on its straight way there overlaps the object or the table: COLLISION;
* nothing that the hand can reach while it comes and closes meets the object: NO_CONTACT. The reach of each link is the
  convex hull of its shapes over all joint angles that the stops and couplings allow, grown by a margin and drawn
  back along the approach. A hull and the object are certainly apart if a face of the hull separates them
  (`bayesgrasp.geometry.separation`);
* the hand, on its straight way and moved through its free closing motion (recorded once from physics without an
  object), stays farther from object and table than a margin: NO_CONTACT, because physics without contact repeats the
  free motion. The way is sampled coarsely and with a wide margin, since the servos of the arm do not follow it exactly.

The first and the third are asked for many attempts at once, in the hand frame.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from jaxtyping import Bool, Float64

from bayesgrasp.lift.attempt import Attempt
from bayesgrasp.lift.free_closing import FreeClosing, Window
from bayesgrasp.lift.hand_kinematics import CLEARANCE, SAMPLE_SPACING, Points
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.robot.gripper import GripperDescription
from bayesgrasp.robot.gripper_model import GripperHandle, add_gripper
from bayesgrasp.robot.physics_scene import ObjectHandle, add_object, new_spec
from bayesgrasp.types import Attempts, GraspType


def below_table(
    position: Float64[np.ndarray, "n 3"],
    rotation: Float64[np.ndarray, "n 3 3"],
    points: Points,
    radii: Float64[np.ndarray, "points"],
) -> Bool[np.ndarray, "n"]:
    """Whether a hand covered by balls around ``points`` (hand frame, metres) reaches below z = 0 at each pose.

    The ball around R p + x reaches down to z^T R p + x_z - r, so only the third row of R is needed.
    """
    heights = position[:, 2:3] + rotation[:, 2, :] @ points.T - radii
    below: Bool[np.ndarray, "n"] = heights.min(axis=1) < 0.0
    return below


def object_in_hand(
    attempts: Attempts, hand_to_world: Float64[np.ndarray, "n 4 4"]
) -> tuple[Float64[np.ndarray, "n 3 3"], Float64[np.ndarray, "n 3"]]:
    """Rotation times scale, and position (metres), of the object of each attempt in the hand frame."""
    x, y, yaw = attempts.object_pose.astype(np.float64).T
    cos, sin, zero = np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)
    turn = np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, zero + 1.0], axis=-1).reshape(-1, 3, 3)
    world_to_hand = np.ascontiguousarray(hand_to_world[:, :3, :3].transpose(0, 2, 1))
    position = np.stack([x, y, zero], axis=-1) - hand_to_world[:, :3, 3]
    linear: Float64[np.ndarray, "n 3 3"] = attempts.scale.astype(np.float64)[:, None, None] * (world_to_hand @ turn)
    return linear, (world_to_hand @ position[:, :, None])[:, :, 0]


class HandAlone:
    """The hand without the arm, moved by hand, near one object on the table (one compiled model per mesh)."""

    def __init__(self, gripper: GripperDescription, asset: ObjectAsset, closing: dict[GraspType, FreeClosing]) -> None:
        spec = new_spec()
        mount = spec.worldbody.add_body(name="hand_mount", mocap=True)
        add_gripper(spec, mount, gripper)
        add_object(spec, asset)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.object = ObjectHandle(self.model)
        self.hand = GripperHandle(self.model, gripper)
        self.model.geom_margin[self.hand.is_geom] = CLEARANCE
        self.closing = closing

    def approach_clearance(self, attempt: Attempt, drawback: float) -> float:
        """Distance (metres, negative for overlap) of the open hand to object or table on its straight way to h.

        It is infinite where it is above `CLEARANCE`. h itself comes first, because it is the likeliest to
        overlap, and the first overlap ends the search.
        """
        self._place(attempt)
        hand_to_world, nearest = attempt.hand_to_world, np.inf
        for distance in np.linspace(0.0, drawback, 1 + math.ceil(drawback / SAMPLE_SPACING)):
            nearest = min(nearest, self._clearance(hand_to_world[:3, 3] - distance * hand_to_world[:3, 0]))
            if nearest < 0.0:
                break
        return nearest

    def closing_window(self, attempt: Attempt, since: int = 0, nearer: float = 0.0) -> Window | None:
        """When the hand, closing on nothing at h, comes near object or table; None if it never does.

        Args:
            attempt: Hand and object.
            since: The first tick that matters.
            nearer: Metres by which the object may yet come nearer.
        """
        self._place(attempt)
        closing = self.closing[attempt.grasp_type]

        def clearance(tick: int) -> float:
            self.data.qpos[self.hand.qpos] = closing.angles[tick]
            return min(self._clearance(attempt.hand_to_world[:3, 3]), CLEARANCE) - nearer

        return closing.window(clearance, since)

    def _place(self, attempt: Attempt) -> None:
        """Open the hand, turn it, and put the object in its place."""
        self.data.qpos[self.hand.qpos] = self.closing[attempt.grasp_type].angles[0]
        self.object.put(self.data, attempt.item)
        mujoco.mju_mat2Quat(self.data.mocap_quat[0], attempt.hand_to_world[:3, :3].ravel())

    def _clearance(self, position: Float64[np.ndarray, "3"]) -> float:
        data = self.data
        data.mocap_pos[0] = position
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_collision(self.model, data)
        if data.ncon == 0:
            return np.inf
        hand = self.hand.is_geom[data.contact.geom]
        return float(data.contact.dist[hand[:, 0] != hand[:, 1]].min(initial=np.inf))
