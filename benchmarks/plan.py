"""Time of a plan, stage by stage: image in, ranked grasps out, model loaded; and of 10,000 posterior samples.

Images are boxes and cans at random poses through the sensor model, seen by the canonical camera and by another one,
which costs a re-projection. Without `--model` the shipped model is timed, and where there is none, untrained weights of
the default architecture, which cost the same. The first call is stated apart: it compiles loops and warms caches.

    python benchmarks/plan.py [--images 20] [--model DIR] [--json FILE]
"""

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro

import bayesgrasp
from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.files import write_json
from bayesgrasp.geometry.camera import Camera, canonical_camera, look_at
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.objects.shapes import box, prism
from bayesgrasp.planning.planner import Planner
from bayesgrasp.posterior.sampling import sample_posterior
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.ratio.checkpoint import Origin, save_model
from bayesgrasp.ratio.local import LocalConfig, LocalSuccess
from bayesgrasp.robot.robotiq_3f import robotiq_3f
from bayesgrasp.seeding import generator
from bayesgrasp.workflows.load import DEFAULT_MODEL

STAGES = ("view", "scene", "encode", "search", "reach")
CAMERAS = ("canonical camera", "another camera")


def meshes() -> list[Mesh]:
    """Boxes and cans that stand on z = 0, metres."""
    solids = (box(0.05, 0.12, 0.18), box(0.07, 0.07, 0.07), prism(0.033, 0.12, 32), prism(0.05, 0.2, 32))
    return [solid.mesh for solid in solids]


def other_camera() -> Camera:
    """A camera of another make, elsewhere."""
    pose = look_at(np.array([0.35, 0.15, 0.65]), np.array([0.0, 0.0, 0.05]))
    return Camera(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5, camera_to_world=pose)


def load(model: Path | None) -> tuple[Planner, str]:
    """A planner, and what its weights are."""
    if model is not None or (DEFAULT_MODEL / "card.json").exists():
        return bayesgrasp.load(model), str(model or "shipped")
    with tempfile.TemporaryDirectory() as directory:
        save_model(Path(directory), {"success": LocalSuccess(LocalConfig())}, Origin(robotiq_3f().name))
        return bayesgrasp.load(directory), "untrained"


def cpu_and_wall(work: Callable[[], object]) -> tuple[float, float]:
    """Milliseconds of process CPU time and of wall-clock time."""
    cpu, wall = time.process_time(), time.perf_counter()
    work()
    return 1e3 * (time.process_time() - cpu), 1e3 * (time.perf_counter() - wall)


def time_camera(planner: Planner, camera: Camera, images: int, seed: int) -> dict[str, Any]:
    """Medians over images, milliseconds: wall-clock and process CPU time of a plan, and wall-clock time by stage.

    `percent` is each stage's share of the total; what is left over is checks and bookkeeping.
    """
    objects = meshes()
    scenes = ScenePrior(len(objects)).sample(images + 1, generator(seed, 0))
    depths = DepthSensor(objects, camera).render(scenes, None, generator(seed, 1))
    first = cpu_and_wall(lambda: planner.plan(depths[0], camera))[1]
    plans, cpu = [], []
    for depth in depths[1:]:
        started = time.process_time()
        plans.append(planner.plan(depth, camera))
        cpu.append(1e3 * (time.process_time() - started))
    stages = {name: float(np.median([plan.timings_ms.get(name, np.nan) for plan in plans])) for name in STAGES}
    total = float(np.median([plan.timings_ms["total"] for plan in plans]))
    return {
        "total": total,
        "total_cpu": float(np.median(cpu)),
        "first_call": first,
        "stages": stages,
        "percent": {name: 100 * ms / total for name, ms in stages.items()},
        "grasps_per_plan": float(np.mean([len(plan.grasps) for plan in plans])),
    }


def time_samples(planner: Planner, seed: int, count: int = 10_000) -> dict[str, float]:
    """Time of posterior samples of one image, milliseconds."""
    objects = meshes()
    scenes = ScenePrior(len(objects)).sample(1, generator(seed, 2))
    image = torch.from_numpy(DepthSensor(objects).images(scenes, None, generator(seed, 3)))
    ratio = planner.likelihood.given_image(image)
    draw = partial(sample_posterior, ratio, planner.prior, count)
    timings = [cpu_and_wall(partial(draw, generator(seed, 4, k))) for k in range(3)]
    cpu, wall = np.median(timings, axis=0)
    return {"samples": count, "cpu": float(cpu), "wall": float(wall)}


def describe(content: dict[str, Any]) -> str:
    """The numbers as lines of text."""
    lines = [f"weights {content['weights']}, loaded in {content['load_ms']:.0f} ms"]
    for name in CAMERAS:
        c = content[name]
        stages = ", ".join(f"{s} {c['stages'][s]:.1f} ms ({c['percent'][s]:.0f} %)" for s in STAGES)
        lines.append(
            f"{name}: {c['total']:.1f} ms ({c['total_cpu']:.1f} ms CPU), first call {c['first_call']:.0f} ms; "
            f"{stages}; {c['grasps_per_plan']:.1f} grasps"
        )
    samples = content["posterior samples"]
    lines.append(f"{samples['samples']} samples: {samples['wall']:.0f} ms ({samples['cpu']:.0f} ms CPU)")
    return "\n".join(lines)


def main(
    images: int = 20, model: Path | None = None, seed: int = 0, threads: int = 2, json: Path | None = None
) -> None:
    """Time plans and samples.

    Args:
        images: Plans per camera, after the first.
        model: Directory of a model.
        seed: Of scenes and noise.
        threads: Threads of the network.
        json: Where to write the numbers.
    """
    torch.set_num_threads(threads)
    loading = time.perf_counter()
    planner, weights = load(model)
    content: dict[str, Any] = {"weights": weights, "load_ms": 1e3 * (time.perf_counter() - loading)}
    for name, camera in zip(CAMERAS, (canonical_camera(), other_camera()), strict=True):
        content[name] = time_camera(planner, camera, images, seed)
    content["posterior samples"] = time_samples(planner, seed)
    print(describe(content))
    if json is not None:
        write_json(json, content)


if __name__ == "__main__":
    tyro.cli(main)
