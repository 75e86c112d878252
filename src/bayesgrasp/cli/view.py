"""``bayesgrasp view``: a plan in the browser."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from pathlib import Path

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.scenes import SceneMaker
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.observation.depth_files import read_depth
from bayesgrasp.viewer.browser import GraspViewer, Seen, open_server
from bayesgrasp.workflows.load import load_planner


def view(
    depth: Path | None = None,
    camera: Path | None = None,
    model: Path | None = None,
    objects: str = "household",
    ycb_dir: Path | None = None,
    seed: int = 0,
    host: str = "127.0.0.1",
    port: int = 8080,
) -> None:
    """Look at a plan in the browser: points, posterior, ranked grasps, constraints set by hand.

    Shows a depth image with its camera, or without one simulated scenes, the next one by a button. Ends with Ctrl-C.

    Args:
        depth: Depth image, as for `bayesgrasp plan`.
        camera: Camera file, likewise.
        model: Directory of a trained model; by default the one that comes with the package.
        objects: Objects of simulated scenes; see `bayesgrasp objects list --split`.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        seed: Of simulated scenes.
        host: Address that is listened on; whoever can reach it can look and change the scene.
        port: Its number.
    """
    if (depth is None) != (camera is None):
        raise InvalidConfigurationError("a depth image needs its camera file: give --depth and --camera, or neither")
    if depth is not None and camera is not None:
        scenes = iter([Seen(read_depth(depth), Camera.load(camera))])
    else:
        scenes = simulated(SceneMaker(load_objects(objects, ycb_dir), seed))
    planner = load_planner(model)
    server = open_server(host, port)
    GraspViewer(server, planner, scenes)
    print(f"look at http://{host}:{server.get_port()}", flush=True)
    try:
        threading.Event().wait()
    finally:
        server.stop()


def simulated(maker: SceneMaker) -> Iterator[Seen]:
    """Scene after scene."""
    for number in itertools.count():
        situation = maker.make(number)
        yield Seen(situation.depth, situation.camera)
