"""Simulation-based Bayesian inference for multi-fingered grasping."""

from pathlib import Path as _Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bayesgrasp.planning.planner import Planner

__version__ = "0.2.0"
__all__ = ["__version__", "load"]


def load(model: "_Path | str | None" = None) -> "Planner":
    """A planner from a trained model: `load().plan(depth, intrinsics, camera_to_world)`.

    Args:
        model: Directory of a model; by default the one that comes with the package.

    Raises:
        CheckpointError: The model is missing, damaged, or was trained for another gripper, camera or schema.
    """
    # Imported here, so that `import bayesgrasp` is quick.
    from bayesgrasp.workflows.load import load_planner

    return load_planner(model)
