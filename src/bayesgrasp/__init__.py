"""Simulation-based Bayesian inference for multi-fingered grasping: `bayesgrasp.load().plan(depth, camera)`.

The names below are what a user types. Each is imported when it is first asked for (PEP 562), so that `import
bayesgrasp` is quick and brings neither torch nor a physics engine.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bayesgrasp.depth.sensor import DepthSensor
    from bayesgrasp.errors import BayesgraspError
    from bayesgrasp.evaluation.scenes import SceneMaker
    from bayesgrasp.geometry.box import Box
    from bayesgrasp.geometry.camera import Camera, canonical_camera
    from bayesgrasp.lift.lift_test import LiftTest
    from bayesgrasp.objects.catalogue import load_objects
    from bayesgrasp.observation.depth_files import read_depth
    from bayesgrasp.planning.constraints import Constraints
    from bayesgrasp.planning.plan import Grasp, Plan
    from bayesgrasp.planning.planner import Planner
    from bayesgrasp.posterior.posterior import Posterior
    from bayesgrasp.prior.grasp import GraspPrior
    from bayesgrasp.types import GraspType, Hands
    from bayesgrasp.workflows.load import load_planner as load
    from bayesgrasp.workflows.train import train

__version__ = "0.2.0"
__all__ = [
    "BayesgraspError",
    "Box",
    "Camera",
    "Constraints",
    "DepthSensor",
    "Grasp",
    "GraspPrior",
    "GraspType",
    "Hands",
    "LiftTest",
    "Plan",
    "Planner",
    "Posterior",
    "SceneMaker",
    "__version__",
    "canonical_camera",
    "load",
    "load_objects",
    "read_depth",
    "train",
]

_HOMES = {
    "BayesgraspError": "errors:BayesgraspError",
    "Box": "geometry.box:Box",
    "Camera": "geometry.camera:Camera",
    "Constraints": "planning.constraints:Constraints",
    "DepthSensor": "depth.sensor:DepthSensor",
    "Grasp": "planning.plan:Grasp",
    "GraspPrior": "prior.grasp:GraspPrior",
    "GraspType": "types:GraspType",
    "Hands": "types:Hands",
    "LiftTest": "lift.lift_test:LiftTest",
    "Plan": "planning.plan:Plan",
    "Planner": "planning.planner:Planner",
    "Posterior": "posterior.posterior:Posterior",
    "SceneMaker": "evaluation.scenes:SceneMaker",
    "canonical_camera": "geometry.camera:canonical_camera",
    "load": "workflows.load:load_planner",
    "load_objects": "objects.catalogue:load_objects",
    "read_depth": "observation.depth_files:read_depth",
    "train": "workflows.train:train",
}
"""Where each name is, `module:name` below this package."""


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, inner = _HOMES[name].split(":")
    found: object = getattr(importlib.import_module(f"{__name__}.{module}"), inner)
    globals()[name] = found  # the next use finds it at once
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
