"""An object of your own, from a mesh file to a lifted object.

    python examples/own_objects.py [MESH MASS]

A mesh file in metres, z upwards, and a mass in kilograms are enough. Without them a bottle is turned on a lathe. The
shipped model has never seen it: it plans from the depth image alone.
"""

import sys
from pathlib import Path

import numpy as np
import trimesh

import bayesgrasp as bg
from bayesgrasp.evaluation.demonstration import demonstrate
from bayesgrasp.types import Outcome


def turn_bottle(path: Path) -> None:
    """Write a bottle of 18 cm: its outline, radius over height in metres, turned about z."""
    outline = [(0.0, 0.0), (0.034, 0.0), (0.034, 0.11), (0.014, 0.14), (0.014, 0.18), (0.0, 0.18)]
    trimesh.creation.revolve(np.array(outline), sections=32).export(path)


def main(mesh: Path, mass: float, scenes: int = 5) -> list[Outcome | None]:
    """Plan for the object in several poses, and try each plan.

    Args:
        mesh: PLY, STL, OBJ or OFF.
        mass: Its mass, kilograms.
        scenes: How many poses.
    """
    (bottle,) = bg.load_objects(mesh=mesh, mass=mass)
    extents = " x ".join(f"{100 * side:.1f}" for side in bottle.extents)
    print(f"{bottle.id}: {extents} cm, {bottle.mass_kg} kg, {len(bottle.parts)} convex parts")
    planner, outcomes = bg.load(), []
    for seed in range(scenes):
        shown = demonstrate(planner, bottle, seed)
        print(f"scene {seed}: {shown.outcome.name.lower() if shown.outcome is not None else shown.plan.reason}")
        outcomes.append(shown.outcome)
    return outcomes


if __name__ == "__main__":
    if len(sys.argv) == 1:
        turn_bottle(Path("bottle.stl"))
        sys.argv += ["bottle.stl", "0.35"]
    main(Path(sys.argv[1]), float(sys.argv[2]))
