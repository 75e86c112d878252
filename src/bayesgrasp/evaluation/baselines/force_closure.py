"""The second baseline: of 100 hands from the prior the one that holds best by force closure on the known mesh.

Each hand's first contacts (`contacts`) resist the wrenches in the convex hull of their friction cones. A contact with
inward normal n pushes with n + mu (cos a t1 + sin a t2), a on a circle, and twists with n +- gamma n / l about its
normal (soft finger); torques are about the centre of mass and divided by l, the object's half diagonal. The score is
the radius of the largest ball around the origin in that hull (Ferrari and Canny 1992): positive is force closure. Of
the hands whose fingers do not start inside the object, the best score that the arm can bring to its place is taken;
both the mesh and the frictions are known to this baseline. Where no hand has two contacts, the first one is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull, QhullError

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.baselines.contacts import ClosingHand, Contacts, closing_hand, first_contacts
from bayesgrasp.evaluation.scenes import Situation
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.posterior.potential import Prior
from bayesgrasp.types import GraspType, Hands


@dataclass(frozen=True)
class ForceClosureConfig:
    """Cost of the baseline.

    Attributes:
        draws: Hands from the prior.
        edges: Of the linearised friction cones.

    Raises:
        InvalidConfigurationError: No draws, or fewer than three edges.
    """

    draws: int = 100
    edges: int = 6

    def __post_init__(self) -> None:
        if self.draws < 1 or self.edges < 3:
            raise InvalidConfigurationError(f"need draws >= 1 and edges >= 3, got {self.draws} and {self.edges}")


class ForceClosure:
    """The strategy.

    Args:
        prior: Where the hands come from.
        lift_test: Says whether the arm can bring a hand to its place.
        config: Cost.
    """

    def __init__(self, prior: Prior, lift_test: LiftTest, config: ForceClosureConfig | None = None) -> None:
        self.prior, self.lift_test, self.config = prior, lift_test, config or ForceClosureConfig()
        self._closing: dict[GraspType, ClosingHand] = {}

    def choose(self, situation: Situation, rng: np.random.Generator) -> Hands:
        """The best hand, batch shape (1,)."""
        hands = self.prior.sample(self.config.draws, rng)
        scores = np.array([self._score(hands, row, situation) for row in range(self.config.draws)])
        ranked = [int(row) for row in np.argsort(-scores, kind="stable") if scores[row] > -np.inf]
        for row in ranked:
            if self.lift_test.feasible(situation.attempts(hands[row : row + 1]))[0]:
                return hands[row : row + 1]
        row = ranked[0] if ranked else 0
        return hands[row : row + 1]

    def _score(self, hands: Hands, row: int, situation: Situation) -> float:
        grasp_type, scale = GraspType(int(hands.grasp_type[row])), float(situation.scene.scale[0])
        if grasp_type not in self._closing:
            self._closing[grasp_type] = closing_hand(self.lift_test.gripper, grasp_type)
        hand_to_world = np.eye(4)
        hand_to_world[:3, :3], hand_to_world[:3, 3] = hands.rotation[row].numpy(), hands.position[row].numpy()
        pose = world_to_object(situation.pose) @ hand_to_world
        contacts = first_contacts(self._closing[grasp_type], pose, situation.asset.parts, scale)
        if contacts.overlap or len(contacts.points) < 2:
            return -np.inf
        nuisances = situation.nuisances
        friction = float(nuisances.lateral_friction[0]), float(nuisances.spinning_friction[0])
        asset = situation.asset
        size = scale * float(np.linalg.norm(asset.extents)) / 2
        return quality(contacts, scale * asset.center_of_mass, size, friction, self.config.edges)


def quality(
    contacts: Contacts, center: Float64[np.ndarray, "3"], size: float, friction: tuple[float, float], edges: int = 6
) -> float:
    """Radius of the largest ball around the origin in the hull of the contacts' wrenches; negative outside.

    Args:
        contacts: At least two.
        center: About which torques are taken, metres.
        size: By which they are divided, metres.
        friction: mu, and gamma in metres.
        edges: Of the linearised cones.
    """
    wrenches = np.concatenate(
        [
            _cone(point, normal, center, size, friction, edges)
            for point, normal in zip(contacts.points, contacts.normals, strict=True)
        ]
    )
    try:
        # The last column of a facet's equation is minus the distance of the origin from it, inside.
        return float(-ConvexHull(wrenches).equations[:, -1].max())
    except QhullError:  # all wrenches in a hyperplane: no ball fits
        return -1.0


def _cone(
    point: Float64[np.ndarray, "3"],
    normal: Float64[np.ndarray, "3"],
    center: Float64[np.ndarray, "3"],
    size: float,
    friction: tuple[float, float],
    edges: int,
) -> Float64[np.ndarray, "wrenches 6"]:
    lateral, spinning = friction
    tangent = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    tangent /= np.linalg.norm(tangent)
    angles = 2 * np.pi * np.arange(edges)[:, None] / edges
    forces = normal + lateral * (np.cos(angles) * tangent + np.sin(angles) * np.cross(normal, tangent))
    torques = np.cross(point - center, forces) / size
    twist = (
        np.stack([normal, normal]),
        np.cross(point - center, normal) / size + np.outer([1, -1], spinning * normal / size),
    )
    return np.concatenate([np.hstack([forces, torques]), np.hstack(twist)])


def world_to_object(pose: tuple[float, float, float]) -> Float64[np.ndarray, "4 4"]:
    """Into the frame of an object at (x, y, yaw), metres and radians."""
    x, y, yaw = pose
    cos, sin = np.cos(yaw), np.sin(yaw)
    moved = np.eye(4)
    moved[:2, :2] = (cos, sin), (-sin, cos)
    moved[:2, 3] = -moved[:2, :2] @ (x, y)
    return moved
