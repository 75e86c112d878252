"""Plans a second of `bayesgrasp serve`, and whether any of many clients at once gets a wrong answer.

Clients ask over sockets for plans of simulated images, each image with a seed of its own; every answer is compared with
the plan that was made of that image alone. The time counted is that of the processor, of server and clients together,
so plans a second are those of one core, whatever else the machine does; wall-clock plans a second stand beside them.

    python benchmarks/serve.py [--clients 20] [--seconds 60] [--workers 1] [--json FILE]
"""

import base64
import io
import json as json_text
import time
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from plan import meshes

import bayesgrasp
from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.files import write_json
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.seeding import generator
from bayesgrasp.serving.app import in_background
from bayesgrasp.serving.service import PlanService, ServiceLimits


def requests_for(images: int, seed: int) -> list[bytes]:
    """One request for each of some simulated images."""
    objects, camera = meshes(), canonical_camera()
    scenes = ScenePrior(len(objects)).sample(images, generator(seed, 0))
    found = []
    for number, depth in enumerate(DepthSensor(objects, camera).render(scenes, None, generator(seed, 1))):
        file = io.BytesIO()
        np.save(file, depth)
        body = {"depth": base64.b64encode(file.getvalue()).decode(), "format": "npy", "camera": camera.to_dict()}
        found.append(json_text.dumps(body | {"seed": number}).encode())
    return found


def ask(address: str, body: bytes) -> dict[str, Any]:
    """The answer without its timings."""
    try:
        with urllib.request.urlopen(urllib.request.Request(address, body), timeout=600) as reply:
            text = reply.read()
    except urllib.error.HTTPError as error:
        text = error.read()
    return comparable(json_text.loads(text))


def comparable(content: dict[str, Any]) -> dict[str, Any]:
    """What must be the same whenever and beside whomever it is computed."""
    return {name: value for name, value in content.items() if name != "timings_ms"}


def main(
    clients: int = 20,
    seconds: float = 60.0,
    workers: int = 1,
    images: int = 20,
    model: Path | None = None,
    seed: int = 0,
    json: Path | None = None,
) -> None:
    """Let many clients ask at once.

    Args:
        clients: How many.
        seconds: How long.
        workers: Plans at a time.
        images: Different requests.
        model: Directory of a model; by default the one that comes with the package.
        seed: Of scenes and noise.
        json: Where to write the numbers.
    """
    torch.set_num_threads(1)
    bodies, limits = requests_for(images, seed), ServiceLimits(workers, most_waiting=clients, longest=600.0)
    service = PlanService(bayesgrasp.load(model), limits)
    alone = [comparable(json_text.loads(json_text.dumps(service.answer(body).content))) for body in bodies]
    began, cpu = time.perf_counter(), time.process_time()

    def client(number: int) -> tuple[int, int]:
        asked = wrong = 0
        while time.perf_counter() - began < seconds:
            chosen = (number + asked) % images
            wrong += ask(f"{address}/plan", bodies[chosen]) != alone[chosen]
            asked += 1
        return asked, wrong

    with in_background(service) as address, ThreadPoolExecutor(clients) as pool:
        asked, wrong = (sum(column) for column in zip(*pool.map(client, range(clients)), strict=True))
    content = {
        "clients": clients,
        "workers": workers,
        "plans": asked,
        "wrong": wrong,
        "plans_per_core_second": asked / (time.process_time() - cpu),
        "plans_per_second": asked / (time.perf_counter() - began),
    }
    print("\n".join(f"{name}: {value:.4g}" for name, value in content.items()))
    if json is not None:
        write_json(json, content)


if __name__ == "__main__":
    tyro.cli(main)
