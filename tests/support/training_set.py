"""Data sets of the fake world to train on, with manifests like those of real simulators."""

from dataclasses import replace
from pathlib import Path

import fake_world

from bayesgrasp.data.manifest import Manifest
from bayesgrasp.generation.chunks import GenerateConfig
from bayesgrasp.generation.pool import InProcess
from bayesgrasp.generation.run import Run, open_store

PRIOR = {"x": [-0.15, 0.15], "y": [-0.15, 0.15], "z": [0.12, 0.34], "kappa": 30.0, "rotation": "modes"}
CONFIG = {"generate": {"grasp": PRIOR}, "scene": {"num_objects": fake_world.OBJECTS}}
MANIFEST: Manifest = replace(fake_world.manifest(), config=CONFIG, gripper="robotiq-3f")


def make_training_set(
    directory: Path, attempts: int, config: GenerateConfig = fake_world.SMALL, manifest: Manifest = MANIFEST
) -> Path:
    """Write a data set; returns its directory."""
    Run(open_store(directory, manifest, False), fake_world.recipe(config), attempts).execute(InProcess())
    return directory
