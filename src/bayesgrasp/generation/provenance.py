"""What a data set was made of and by which program, for its manifest."""

from __future__ import annotations

import hashlib
import json
import subprocess
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from bayesgrasp.data.manifest import Manifest
from bayesgrasp.generation.chunks import GenerateConfig, SimulatedWorld
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.prior.cameras import AnyCamera
from bayesgrasp.prior.scene import ScenePrior


def describe(world: SimulatedWorld, config: GenerateConfig, seed: int, scene: ScenePrior, attempts: int) -> Manifest:
    """The manifest of a data set that is about to be made."""
    settings = {
        "generate": asdict(config),
        "scene": asdict(scene),
        "lift_test": world.lift_test.settings(),
        "sensor": asdict(world.sensor),
    }
    if isinstance(config.camera, AnyCamera):
        settings["stereo"] = asdict(world.stereo)
    hand = world.gripper.identity
    return Manifest(
        seed=seed,
        config=json.loads(json.dumps(settings, default=str)),  # as it will be read back: tuples become lists
        objects=[
            {"id": asset.id, "sha256": object_hash(asset), "split": asset.split, "mass_kg": asset.mass_kg}
            for asset in world.objects
        ],
        gripper=hand.name,
        gripper_sha256=hand.sha256,
        attempts=attempts,
        commit=source_commit(),
        version=metadata.version("bayesgrasp"),
    )


def object_hash(asset: ObjectAsset) -> str:
    """SHA-256 of what the simulators see of an object: its mesh, its convex parts and where it is heavy."""
    arrays: list[Any] = [asset.vertices, asset.faces, asset.center_of_mass, asset.inertia]
    arrays += [array for part in asset.parts for array in (part.vertices, part.faces)]
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(str(array.shape).encode() + np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def source_commit() -> str:
    """Commit of the source tree that this program runs from; empty where it is installed without one."""
    source = Path(__file__).parents[3]
    if not (source / ".git").exists():
        return ""
    command = ["git", "-C", str(source), "rev-parse", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
