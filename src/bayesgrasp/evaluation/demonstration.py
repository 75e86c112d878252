"""One object from its depth image to the lift: a scene, the plan for its image, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from bayesgrasp.evaluation.scenes import SceneMaker, Situation
from bayesgrasp.evaluation.strategies import first_grasp
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.planning.plan import Plan
from bayesgrasp.planning.planner import Planner
from bayesgrasp.types import Attempts, Outcome

SAMPLES = 2000
"""Draws from the posterior, for the marginals of a figure."""


@dataclass(frozen=True)
class Demonstration:
    """A scene, the plan for its image, and what became of it.

    Attributes:
        situation: The object at a random pose, and its image by a simulated Kinect.
        plan: From that image alone.
        attempt: The lift test of the plan's first grasp; None where there is none.
        outcome: How that ended.
    """

    situation: Situation
    plan: Plan
    attempt: Attempts | None
    outcome: Outcome | None

    def to_dict(self) -> dict[str, Any]:
        """Scene, plan and outcome as plain data under the attributes' names; metres, radians."""
        scene, nuisances = self.situation.scene, self.situation.nuisances
        return {
            "situation": {
                "asset": self.situation.asset.id,
                "pose": list(self.situation.pose),
                "scene": {"scale": float(scene.scale[0])},
                "nuisances": {"lateral_friction": float(nuisances.lateral_friction[0])},
            },
            "plan": self.plan.to_dict(),
            "outcome": None if self.outcome is None else self.outcome.name.lower(),
        }


def demonstrate(planner: Planner, asset: ObjectAsset, seed: int = 0) -> Demonstration:
    """Put an object on the table, take its picture, plan, and try the best grasp.

    Args:
        planner: Who plans.
        asset: The object.
        seed: Of the scene, the sensor's noise and the plan.
    """
    situation = SceneMaker((asset,), seed).make(0)
    plan = planner.plan(situation.depth, canonical_camera(), samples=SAMPLES, seed=seed)
    hands = first_grasp(plan)
    if hands is None:
        return Demonstration(situation, plan, None, None)
    attempt = situation.attempts(hands)
    outcome = Outcome(int(LiftTest((asset,)).run(attempt)[0]))
    return Demonstration(situation, plan, attempt, outcome)
