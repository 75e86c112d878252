"""Plans on real depth images: do the grasps sit on the object, clear of the table and the surface?

For each image the best grasp is judged twice by the measured points: as the posterior has it (the MAP, whatever it cuts
into) and as the planner returns it (clear of the measured surface, reachable). A grasp is on the object if at least a
fifth of the object's points lie between the fingers, and clear if the open hand cuts into neither surface nor table.
Writes one picture per image and a table.

    python benchmarks/real_images.py --images ../shared/real_depth --out results/real_depth [--model DIR]
"""

import json
from dataclasses import replace
from pathlib import Path

import torch
import tyro

import bayesgrasp
from bayesgrasp.errors import DepthImageError
from bayesgrasp.files import write_json
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.observation.depth_files import read_depth
from bayesgrasp.planning.figure import save_plan_figure
from bayesgrasp.planning.plan import Plan
from bayesgrasp.planning.planner import Planner

ENOUGH = 0.2
"""Share of the object's points between the fingers."""


def uncritical(planner: Planner) -> Planner:
    """The same planner, but it returns the best of the posterior, even if that cuts into the surface."""
    selection = replace(planner.config.selection, penetration=10.0, rank="posterior")
    return replace(planner, config=replace(planner.config, selection=selection))


def judge(plan: Plan, planner: Planner) -> dict[str, object]:
    """What the measured points say of the best grasp."""
    if not plan.grasps:
        return {"planned": False, "reason": plan.reason}
    best, selection = plan.grasps[0], planner.config.selection
    lowest = planner.robot.hand.lowest(best.hand_to_world, best.grasp_type)
    return {
        "planned": True,
        "on_object": best.on_object >= ENOUGH,
        "clear": best.clearance > -2 * selection.penetration and lowest > -selection.penetration,
        "object_between_fingers": round(best.on_object, 3),
        "clearance_m": round(best.clearance, 4),
        "above_table_m": round(lowest, 4),
        "success_probability": round(best.success_probability, 3),
        "grasp_type": best.grasp_type.name.lower(),
        "unfamiliarity": plan.observed.unfamiliarity,
        "ms": round(plan.timings_ms["total"]),
    }


def main(images: Path, out: Path, model: Path | None = None, pose: bool = True, seed: int = 0) -> None:
    """Plan on every `depth_*.npy` of a directory with a `camera.json`.

    Args:
        images: The directory.
        out: Where pictures and table go.
        model: Directory of a model; by default the shipped one.
        pose: Use the published camera pose; else table and object are found in the image.
        seed: Of all draws.
    """
    torch.set_num_threads(1)
    camera = Camera.load(images / "camera.json")
    camera = camera if pose else camera.with_pose(None)
    files = sorted(images.glob("depth_*.npy"))
    if not files:
        raise DepthImageError(f"there is no depth_*.npy in {images}")
    out.mkdir(parents=True, exist_ok=True)
    planner = bayesgrasp.load(model)
    rows = {}
    for path in files:
        depth = read_depth(path)
        plan = planner.plan(depth, camera, top=5, samples=2000, seed=seed)
        raw = uncritical(planner).plan(depth, camera, top=1, seed=seed)
        rows[path.stem] = {"map": judge(raw, planner), "plan": judge(plan, planner), "warnings": plan.warnings}
        save_plan_figure(out / f"{path.stem}.png", plan, depth, camera, planner.robot.hand)
    summary = {name: summarize([row[name] for row in rows.values()]) for name in ("map", "plan")}  # type: ignore[misc]
    print(json.dumps(summary, indent=1))
    write_json(out / "grasps.json", {"summary": summary, "images": rows})


def summarize(verdicts: list[dict[str, object]]) -> dict[str, str]:
    """Shares over the images."""
    return {
        name: f"{sum(bool(v.get(name)) for v in verdicts)}/{len(verdicts)}"
        for name in ("planned", "on_object", "clear")
    }


if __name__ == "__main__":
    tyro.cli(main)
