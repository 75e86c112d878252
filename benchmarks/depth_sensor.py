"""How fast the depth sensor is, where its time goes, and the same scenes through MuJoCo's own rays and renderer.

python benchmarks/depth_sensor.py [--ycb-dir DIR] [--images 200] [--json FILE]

Times are CPU seconds of this process on one core. MuJoCo draws what `render_clean` draws (true depth, no shadow, no
noise); its depths are compared with ours on the same pixels. Its renderer needs a software OpenGL (MUJOCO_GL=egl).
"""

from __future__ import annotations

import json as json_module
import os
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
import tyro
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from bayesgrasp.depth import devices, kinect_kernels, ray_kernels
from bayesgrasp.depth import sensor as depth_module
from bayesgrasp.depth.mesh_tree import MeshTree
from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.files import write_json
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.geometry.camera_nuisances import disturbed_camera
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.observation.preprocess import preprocess
from bayesgrasp.prior.nuisance import CameraPrior
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.seeding import generator
from bayesgrasp.types import CameraNuisances, Scenes

STAGES: dict[str, list[tuple[Any, str]]] = {
    "object rays": [(MeshTree, "first_hit")],
    "shadow rays": [(MeshTree, "occluded")],
    "geometry of rays and hits": [
        (ray_kernels, name)
        for name in ("project_hull", "outline", "row_spans", "bounding_box", "primary_rays", "resolve")
    ],
    "matching windows": [(kinect_kernels, "match")],
    "noise of the table": [(kinect_kernels, "sense_table")],
    "noise near the object": [(kinect_kernels, "sense_matches")],
    "random numbers": [(devices, "lattice")],
    "cameras": [(depth_module, "object_views")],
}


@contextmanager
def stopwatch() -> Iterator[dict[str, float]]:
    """Replace the functions of each stage by timed ones; yields CPU seconds by stage."""
    spent: dict[str, float] = defaultdict(float)
    originals = [(owner, name, getattr(owner, name)) for parts in STAGES.values() for owner, name in parts]

    def timed(stage: str, function: Callable[..., object]) -> Callable[..., object]:
        def call(*args: object, **options: object) -> object:
            start = process_time()
            try:
                return function(*args, **options)
            finally:
                spent[stage] += process_time() - start

        return call

    for stage, parts in STAGES.items():
        for owner, name in parts:
            setattr(owner, name, timed(stage, getattr(owner, name)))
    try:
        yield spent
    finally:
        for owner, name, function in originals:
            setattr(owner, name, function)


def seconds_per_image(function: Callable[[], object], images: int) -> float:
    """CPU seconds, best of three runs: what else runs on the machine only ever adds."""
    spent = []
    for _ in range(3):
        start = process_time()
        function()
        spent.append(process_time() - start)
    return min(spent) / images


class MujocoScene:
    """One scene of ours in MuJoCo."""

    def __init__(self, asset: ObjectAsset, scene: Scenes, camera: Camera) -> None:
        spec = mujoco.MjSpec()
        spec.visual.global_.offwidth, spec.visual.global_.offheight = camera.width, camera.height
        spec.visual.map.znear, spec.visual.map.zfar, spec.stat.extent = 0.01, 20.0, 1.0
        mesh = spec.add_mesh(name="object", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert, mesh.userface = (asset.vertices * float(scene.scale[0])).ravel(), asset.faces.ravel()
        x, y, yaw = (float(value) for value in scene.object_pose[0])
        turn = [np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)]
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="object", pos=[x, y, 0], quat=turn)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
        axes = Rotation.from_matrix(camera.pose[:3, :3] @ np.diag([1.0, -1.0, -1.0])).as_quat(scalar_first=True)
        angle = np.rad2deg(2 * np.arctan(camera.height / 2 / camera.fy))
        spec.worldbody.add_camera(name="eye", pos=camera.pose[:3, 3], quat=axes, fovy=angle)
        self.camera, self.model = camera, spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        unit = camera.rays() @ camera.pose[:3, :3].T
        self.lengths = np.linalg.norm(unit, axis=-1)
        self.directions = (unit / self.lengths[..., None]).reshape(-1)

    def rays(self) -> Float[np.ndarray, "h w"]:
        """Depth by `mj_multiRay`, metres."""
        count = self.lengths.size
        geom, distance = np.empty(count, np.int32), np.empty(count)
        eye = self.camera.pose[:3, 3].copy()
        mujoco.mj_multiRay(
            self.model, self.data, eye, self.directions, None, True, -1, geom, distance, None, count, 1e3
        )
        depth: Float[np.ndarray, "h w"] = np.where(distance > 0, distance, 0).reshape(self.lengths.shape) / self.lengths
        return depth

    def renderer(self) -> Callable[[], Float[np.ndarray, "h w"]]:
        """A function that renders depth by OpenGL, metres."""
        renderer = mujoco.Renderer(self.model, self.camera.height, self.camera.width)
        renderer.enable_depth_rendering()

        def draw() -> Float[np.ndarray, "h w"]:
            renderer.update_scene(self.data, camera="eye")
            depth: Float[np.ndarray, "h w"] = renderer.render()
            return depth

        return draw


def against_mujoco(objects: tuple[ObjectAsset, ...], scenes: Scenes, cameras: CameraNuisances) -> dict[str, float]:
    """Milliseconds an image, and how the depths differ, over some scenes."""
    sensor = DepthSensor(objects)
    level = CameraNuisances(**{**cameras.columns(), "field_of_view_factor": np.ones(len(cameras), np.float32)})
    spent: dict[str, list[float]] = defaultdict(list)
    error: dict[str, list[np.ndarray]] = defaultdict(list)
    for i in range(len(scenes)):
        one, camera = scenes[i : i + 1], level[i : i + 1]
        theirs = MujocoScene(objects[one.object_index[0]], one, disturbed_camera(sensor.camera, camera, 0))
        ours = sensor.render_clean(one, camera)[0]
        ways = {"mujoco rays": theirs.rays, "mujoco renderer": theirs.renderer()}
        spent["render_clean"].append(seconds_per_image(partial(sensor.render_clean, one, camera), 1))
        for name, draw in ways.items():
            spent[name].append(seconds_per_image(draw, 1))
            error[name].append(abs(draw() - ours).ravel())
    report = {f"{name}, ms": 1e3 * float(np.mean(values)) for name, values in spent.items()}
    for name, parts in error.items():
        difference = np.concatenate(parts)
        report[f"{name}, median difference mm"] = 1e3 * float(np.median(difference))
        report[f"{name}, share within 0.01 mm"] = float((difference < 1e-5).mean())
        report[f"{name}, share beyond 1 mm"] = float((difference > 1e-3).mean())
    return report


def main(ycb_dir: Path | None = None, images: int = 200, mujoco_scenes: int = 8, json: Path | None = None) -> None:
    """Measure and report.

    Args:
        ycb_dir: Scans; by default $BAYESGRASP_YCB_DIR, and household objects only without.
        images: How many are timed.
        mujoco_scenes: How many of these scenes MuJoCo draws, too.
        json: Where to write the numbers.
    """
    objects = load_objects("all", ycb_dir)
    rng, n = generator(0), images
    scenes, cameras = ScenePrior(len(objects)).sample(n, rng), CameraPrior().sample(n, rng)
    sensor = DepthSensor(objects)
    sensor.images(scenes[:2], cameras[:2], rng)  # compiles
    fast = seconds_per_image(lambda: sensor.images(scenes, cameras, rng), n)
    few = max(1, n // 4)
    full = seconds_per_image(lambda: preprocess(sensor.render(scenes[:few], cameras[:few], rng)), few)
    with stopwatch() as spent:
        sensor.images(scenes, cameras, rng)
    total = sum(spent.values())
    report = {
        "objects": len(objects),
        "images_per_second": 1 / fast,
        "full_images_per_second": 1 / full,
        "share_of_time": {stage: seconds / total for stage, seconds in sorted(spent.items(), key=lambda s: -s[1])},
        "same_scene": against_mujoco(objects, scenes[:mujoco_scenes], cameras[:mujoco_scenes]),
        "load_average": os.getloadavg()[0],
        "command": f"python benchmarks/depth_sensor.py --images {n} --ycb-dir DIR",
    }
    print(json_module.dumps(report, indent=1))
    if json is not None:
        write_json(json, report)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
