"""What a wrongly stated camera pose costs, whether it is noticed, and what correcting it by the table gains back.

    python benchmarks/wrong_pose.py [--ycb-dir DIR] [--model DIR] [--scenes 240] [--json results/wrong_pose.json]

The stated pose is the nominal one, turned about the camera's centre around a random axis and shifted in a random
direction. A grasp is tried where the planner says it is in the world, and where it says it is from the camera, as for a
robot that knows the camera's pose better than the camera file does. Seeds are not those of the benchmark.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from bayesgrasp.cli.progress import counting
from bayesgrasp.diagnostics.intervals import paired_difference, wilson
from bayesgrasp.evaluation.scenes import SceneMaker, Situation
from bayesgrasp.files import write_json
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.planning.plan import Plan
from bayesgrasp.planning.planner import Planner
from bayesgrasp.types import Hands, Outcome
from bayesgrasp.workflows.load import DEFAULT_MODEL, load_planner

ERRORS = ((0.0, 0.0), (1.0, 0.01), (2.0, 0.02), (5.0, 0.0))
"""Angle, degrees, and distance, metres, by which the stated pose is off."""
WORDS = "pose"
"""What the warnings of a wrong pose have in common."""


@dataclass(frozen=True)
class Bench:
    """What plans are made and tried with."""

    scenes: SceneMaker
    lift_test: LiftTest
    planners: dict[str, Planner]


def main(
    ycb_dir: Path | None = None,
    model: Path = DEFAULT_MODEL,
    split: str = "train",
    scenes: int = 240,
    seed: int = 3000,
    json: Path | None = None,
) -> None:
    """Print success rates with their 95 % intervals.

    Args:
        ycb_dir: Scans; by default $BAYESGRASP_YCB_DIR.
        model: Whose plans are tried.
        split: Objects.
        scenes: For each error.
        seed: Of scenes, errors and plans.
        json: Where to write the numbers.
    """
    torch.set_num_threads(1)
    objects, planner = load_objects(split, ycb_dir), load_planner(model)
    planners = {"stated": planner, "refined": planner.refining_pose()}
    bench = Bench(SceneMaker(objects, seed), LiftTest(objects), planners)
    rows: list[dict[str, Any]] = []
    with counting("plans", scenes * len(ERRORS)) as progress:
        for error in ERRORS:
            tried = []
            for number in range(scenes):
                tried.append(trial(bench, number, *error))
                progress(len(rows) // len(planners) * scenes + len(tried))
            rows += [row(error, name, [t[name] for t in tried]) for name in planners]
    exact = {one["planner"]: one for one in rows if one["error"] == list(ERRORS[0])}
    for one in rows:
        one |= {f"lost_in_{frame}": lost(exact[one["planner"]], one, frame) for frame in ("world", "camera")}
        print(
            f"{one['error'][0]:.0f} degrees {100 * one['error'][1]:.0f} cm, {one['planner']:7s}: "
            f"world {100 * one['world']['rate']:.1f} %, camera {100 * one['camera']['rate']:.1f} %, "
            f"noticed {100 * one['noticed']:.0f} %"
        )
    if json is not None:
        content = [{key: value for key, value in one.items() if key != "won"} for one in rows]
        write_json(json, {"split": split, "scenes": scenes, "seed": seed, "rows": content})


def trial(bench: Bench, number: int, angle: float, distance: float) -> dict[str, dict[str, bool]]:
    """By planner: success in the world and from the camera, and whether the pose was doubted."""
    situation = bench.scenes.make(number)
    camera, found = misstated(canonical_camera(), angle, distance, np.random.default_rng(number)), {}
    for name, planner in bench.planners.items():
        plan = planner.plan(situation.depth, camera, top=1, seed=number)
        doubted = any(WORDS in warning for warning in plan.warnings)
        found[name] = {**succeed(bench.lift_test, situation, plan), "noticed": doubted}
    return found


def misstated(camera: Camera, angle: float, distance: float, rng: np.random.Generator) -> Camera:
    """The camera with a wrong pose; the same directions for the same generator, whatever the size of the error."""
    axis, way = (direction / np.linalg.norm(direction) for direction in rng.standard_normal((2, 3)))
    pose = camera.pose.copy()
    pose[:3, :3] = Rotation.from_rotvec(np.radians(angle) * axis).as_matrix() @ pose[:3, :3]
    pose[:3, 3] += distance * way
    return camera.with_pose(pose)


def succeed(lift_test: LiftTest, situation: Situation, plan: Plan) -> dict[str, bool]:
    """S of the best grasp where it is said to be in the world, and from the camera; False without a grasp."""
    if not plan.grasps:
        return {"world": False, "camera": False}
    best = plan.grasps[0]
    poses = np.stack([best.hand_to_world, canonical_camera().pose @ best.hand_to_camera])
    outcomes = lift_test.run(situation.attempts(hands_of(poses, int(best.grasp_type))))
    return {name: bool(o == Outcome.SUCCESS) for name, o in zip(("world", "camera"), outcomes, strict=True)}


def hands_of(poses: Float64[np.ndarray, "n 4 4"], grasp_type: int) -> Hands:
    """Hands of one grasp type."""
    moved = torch.from_numpy(poses).float()
    return Hands(moved[:, :3, 3], moved[:, :3, :3], torch.full((len(poses),), grasp_type))


def row(error: tuple[float, float], name: str, tried: list[dict[str, bool]]) -> dict[str, Any]:
    """Rates of one planner under one error."""
    won = {frame: np.array([t[frame] for t in tried]) for frame in ("world", "camera")}
    rates = {
        frame: {"rate": float(w.mean()), "interval": wilson(int(w.sum()), len(w)), "n": len(w)}
        for frame, w in won.items()
    }
    return {
        "error": list(error),
        "planner": name,
        **rates,
        "noticed": np.mean([t["noticed"] for t in tried]),
        "won": won,
    }


def lost(exact: dict[str, Any], one: dict[str, Any], frame: str) -> dict[str, Any]:
    """How much less often grasps succeed than with the exact pose, in the same scenes."""
    difference, interval = paired_difference(exact["won"][frame], one["won"][frame])
    return {"difference": difference, "interval": interval}


if __name__ == "__main__":
    tyro.cli(main)
