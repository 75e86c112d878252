r"""Planar refresh: one simulated attempt stands for every place of the object on the table.

Physics depends on the hand h and the planar pose p_O only through the hand's pose rho relative to the object. The map
(h, p_O) -> (rho, p_O) keeps the measure, so under the prior

    p(rho, p_O) = p(h(rho, p_O)) p(p_O),     p(rho) = \int p(h(rho, p_O)) p(p_O) dp_O,

and one may redraw p_O from p(p_O | rho) = p(h(rho, p_O)) p(p_O) / p(rho) and carry the hand along: a Gibbs move, which
leaves p(h, O, p_O | S = 1) as it is. The arm breaks the symmetry, so a move must keep what the arm can do: reachable
attempts stay reachable, unreachable ones unreachable. A redraw that does not is repeated; if it never succeeds the
attempt stays where it is, which happens with a probability that depends on rho alone and so keeps the law too.

The marginal p(rho) carries the same attempts into a *given* pose, with weight p(h(rho, p_O)) / p(rho). For the box of
positions and uniform p_O, with t the relative position and R the relative rotation, it is one integral over the yaw,

    p(rho) = p(g) / V * mean over yaw of p(R_z(yaw) R) * a_x(yaw) * a_y(yaw),

where V is the volume of the box and a_x the share of x_O for which x_O + (R_z t)_x is in it; the trapezoidal rule on
the circle converges at once, since p(R) is smooth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int64, UInt8

from bayesgrasp.geometry import so3
from bayesgrasp.geometry.hand_arrays import hands_of
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.ranges import Interval
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import Attempts, Columns

Reachable = Callable[[Attempts], Bool[np.ndarray, "n"]]
"""Whether the arm reaches each attempt."""

MARGIN = 1.02
"""The largest p(R_z(yaw) R) over all yaws is at most this much above its largest value on the grid of 64 nodes."""
AT_ONCE, MAX_DRAWS = 4, 200
"""Poses proposed at once, and in all, for a draw from p(p_O | rho)."""
MAX_REDRAWS = 50
"""Draws from p(p_O | rho) before an attempt that would change sides of the arm's reach is left where it is."""


@dataclass(frozen=True)
class RelativeHands(Columns):
    """Hands in the frame of their object, float64.

    Attributes:
        position: Palm origin in the object frame, metres (not divided by the scale).
        quaternion: hand_to_object rotation, (w, x, y, z), of unit length.
        grasp_type: `GraspType` values.
    """

    position: Float64[np.ndarray, "n 3"]
    quaternion: Float64[np.ndarray, "n 4"]
    grasp_type: UInt8[np.ndarray, "n"]


def to_object(attempts: Attempts) -> RelativeHands:
    """The hands of attempts relative to their objects."""
    pose = attempts.object_pose.astype(np.float64)
    offset = attempts.position.astype(np.float64)
    offset[:, :2] -= pose[:, :2]
    quaternion = attempts.quaternion.astype(np.float64)
    quaternion /= np.linalg.norm(quaternion, axis=-1, keepdims=True)
    return RelativeHands(turn(offset, -pose[:, 2]), turn_rotation(quaternion, -pose[:, 2]), attempts.grasp_type)


def to_world(
    hands: RelativeHands, object_pose: Float[np.ndarray, "n 3"]
) -> tuple[Float64[np.ndarray, "n 3"], Float64[np.ndarray, "n 4"]]:
    """Position and quaternion in the world frame of hands whose objects stand at ``object_pose``."""
    pose = object_pose.astype(np.float64)
    position = turn(hands.position, pose[:, 2])
    position[:, :2] += pose[:, :2]
    return position, turn_rotation(hands.quaternion, pose[:, 2])


def turn(
    vector: Float64[np.ndarray, "*batch 3"], yaw: Float64[np.ndarray, "*batch"]
) -> Float64[np.ndarray, "*batch 3"]:
    """R_z(yaw) v."""
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, z = np.moveaxis(vector, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


def turn_rotation(
    quaternion: Float64[np.ndarray, "*batch 4"], yaw: Float64[np.ndarray, "*batch"]
) -> Float64[np.ndarray, "*batch 4"]:
    """The quaternion of R_z(yaw) R(q)."""
    c, s = np.cos(yaw / 2), np.sin(yaw / 2)
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    return np.stack([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=-1)


def moved(attempts: Attempts, hands: RelativeHands, object_pose: Float[np.ndarray, "n 3"]) -> Attempts:
    """The same attempts with object and hand moved together to ``object_pose``, rounded to float32."""
    pose = object_pose.astype(np.float32)
    position, quaternion = to_world(hands, pose)
    return replace(
        attempts,
        object_pose=pose,
        position=position.astype(np.float32),
        quaternion=quaternion.astype(np.float32),
    )


@dataclass(frozen=True)
class PlanarRefresh:
    """The planar symmetry of the two priors, and the moves along it.

    Attributes:
        grasp: p(h).
        scene: p(p_O); its x, y and yaw are uniform.
        reachable: What the arm can do; None where there is no arm.
        nodes: Nodes of the integral over the yaw.
    """

    grasp: GraspPrior
    scene: ScenePrior
    reachable: Reachable | None = None
    nodes: int = 64

    def log_density(self, attempts: Attempts) -> Float64[np.ndarray, "n"]:
        """Log p(h) of each hand; -inf outside the support."""
        return self.grasp.log_prob(hands_of(attempts).to(dtype=torch.float64)).numpy()

    def log_marginal(self, hands: RelativeHands) -> Float64[np.ndarray, "n"]:
        """Log p(rho), with respect to the measure of p(h); -inf where no pose brings the hand into the support."""
        # With (u, v) the position turned by a yaw, the hand is at (x_O + u, y_O + v): one share for each axis.
        yaw = self._yaw_nodes()
        shape = (len(hands), self.nodes)
        world = turn(np.broadcast_to(hands.position[:, None], (*shape, 3)), np.broadcast_to(yaw, shape))
        shares = _share_inside(world[..., 0], self.scene.x, self.grasp.x)
        shares = shares * _share_inside(world[..., 1], self.scene.y, self.grasp.y)
        mean = (np.exp(self._log_rotation(hands, yaw)) * shares).mean(-1)
        z = hands.position[:, 2]
        # Rounding to float32 may put a hand of the box's very border outside by one unit in the last place.
        in_box = (z >= self.grasp.z[0] - 1e-6) & (z <= self.grasp.z[1] + 1e-6)
        in_use = np.isin(hands.grasp_type, self.grasp.types)
        with np.errstate(divide="ignore"):
            log_mean = np.log(np.where(in_box & in_use, mean, 0.0))
        return log_mean + self.grasp.log_prob_position() - math.log(len(self.grasp.types))

    def sample_pose(self, hands: RelativeHands, rng: np.random.Generator) -> Float64[np.ndarray, "n 3"]:
        """A draw from p(p_O | rho) for each hand, by rejection; NaN where `MAX_DRAWS` proposals were all rejected.

        Proposals are uniform; the yaw is accepted with the ratio of p(R_z(yaw) R) to its bound, x and y if they bring
        the hand into the box.
        """
        bound = self._log_rotation(hands, self._yaw_nodes()).max(-1) + math.log(MARGIN)
        poses = np.full((len(hands), 3), np.nan)
        waiting = np.arange(len(hands))
        for _ in range(MAX_DRAWS // AT_ONCE):
            rows = np.repeat(waiting, AT_ONCE)
            proposed = self.scene.sample_pose(len(rows), rng).astype(np.float64)
            log_ratio = self._log_inside(hands[rows], proposed) - bound[rows]
            accepted = (np.log(rng.random(len(rows))) < log_ratio).reshape(-1, AT_ONCE)
            found = accepted.any(axis=1)
            first = proposed.reshape(-1, AT_ONCE, 3)[np.arange(len(waiting)), accepted.argmax(axis=1)]
            poses[waiting[found]] = first[found]
            waiting = waiting[~found]
            if len(waiting) == 0:
                break
        return poses

    def redraw(
        self, attempts: Attempts, reached: Bool[np.ndarray, "n"], rng: np.random.Generator
    ) -> tuple[Attempts, Int64[np.ndarray, "n"]]:
        """Move every attempt to a fresh pose on the same side of the arm's reach.

        Args:
            attempts: Attempts under the prior, or weighted to it.
            reached: Whether the arm reached each attempt where it was made.
            rng: Where the poses come from.

        Returns:
            The moved attempts, and how many draws from p(p_O | rho) each took. For reached attempts that number has
            the mean 1 / P(reachable | rho), so it is an unbiased weight against the attempts that the arm lost.
        """
        hands = to_object(attempts)
        poses = attempts.object_pose.astype(np.float64)
        trials = np.zeros(len(attempts), dtype=np.int64)
        waiting = np.arange(len(attempts))
        for _ in range(MAX_REDRAWS):
            proposed = self.sample_pose(hands[waiting], rng)
            trials[waiting] += 1
            kept = self._same_side(attempts[waiting], hands[waiting], proposed, reached[waiting])
            poses[waiting[kept]] = proposed[kept]
            waiting = waiting[~kept]
            if len(waiting) == 0 or self.reachable is None:
                break
        stay = np.zeros(len(attempts), dtype=bool)
        stay[waiting] = True
        fresh = moved(attempts, hands, poses)
        return _choose(stay, attempts, fresh), trials

    def _same_side(
        self,
        attempts: Attempts,
        hands: RelativeHands,
        poses: Float64[np.ndarray, "n 3"],
        reached: Bool[np.ndarray, "n"],
    ) -> Bool[np.ndarray, "n"]:
        drawn: Bool[np.ndarray, "n"] = np.isfinite(poses).all(-1)
        if self.reachable is not None and drawn.any():
            there = moved(attempts[drawn], hands[drawn], poses[drawn])
            drawn[drawn] = self.reachable(there) == reached[drawn]
        return drawn

    def _yaw_nodes(self) -> Float64[np.ndarray, "nodes"]:
        low, high = self.scene.yaw
        return low + (high - low) * (np.arange(self.nodes) + 0.5) / self.nodes

    def _log_rotation(self, hands: RelativeHands, yaw: Float64[np.ndarray, "nodes"]) -> Float64[np.ndarray, "n nodes"]:
        shape = (len(hands), len(yaw))
        turned = turn_rotation(np.broadcast_to(hands.quaternion[:, None], (*shape, 4)), np.broadcast_to(yaw, shape))
        return self.grasp.log_prob_rotation(so3.quaternion_to_matrix(torch.from_numpy(turned))).numpy()

    def _log_inside(self, hands: RelativeHands, poses: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n"]:
        """Log p(R) where the hand, rounded as it will be stored, is inside the box; -inf elsewhere."""
        position, quaternion = to_world(hands, poses.astype(np.float32))
        position = position.astype(np.float32).astype(np.float64)
        low, high = np.array(self.grasp.low)[:2], np.array(self.grasp.high)[:2]
        inside = ((position[:, :2] >= low) & (position[:, :2] <= high)).all(-1)
        log_rotation = self.grasp.log_prob_rotation(so3.quaternion_to_matrix(torch.from_numpy(quaternion))).numpy()
        return np.where(inside, log_rotation, -np.inf)


def _choose(stay: Bool[np.ndarray, "n"], old: Attempts, new: Attempts) -> Attempts:
    """Row by row the old attempt where it stays, else the new one."""
    columns = {
        name: np.where(stay.reshape(-1, *[1] * (column.ndim - 1)), column, new.columns()[name])
        for name, column in old.columns().items()
    }
    return type(old)(**columns)


def _share_inside(
    offset: Float64[np.ndarray, "*batch"], place: Interval, box: Interval
) -> Float64[np.ndarray, "*batch"]:
    """Share of the places in ``place`` for which place + offset is inside ``box``."""
    # place + offset is in [a, b] where place is in [a - offset, b - offset]: the length of an intersection.
    width = place[1] - place[0]
    if width == 0:
        return ((place[0] + offset >= box[0]) & (place[0] + offset <= box[1])).astype(np.float64)
    low = np.maximum(place[0], box[0] - offset)
    high = np.minimum(place[1], box[1] - offset)
    shares: Float64[np.ndarray, "*batch"] = np.clip(high - low, 0.0, None) / width
    return shares
