"""Which objects a command works on: options that several commands share, under the same names in each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.objects.object_asset import ObjectAsset


@dataclass(frozen=True)
class ObjectSet:
    """Which objects.

    Attributes:
        split: train, train-ycb, unseen, household, stand-ins, other, all, procedural:N@SEED (objects 0 to N - 1 of a
            seed of the generator), one object's id, or several of these joined by +: train+procedural:2000@7.
        ycb_dir: Directory with YCB scans; by default $BAYESGRASP_YCB_DIR.
        mesh: A mesh file to use instead (metres, z upwards); needs --mass.
        mass: Its mass, kg.
    """

    split: str = "train"
    ycb_dir: Path | None = None
    mesh: Path | None = None
    mass: float | None = None

    def load(self) -> tuple[ObjectAsset, ...]:
        """Load them."""
        return load_objects(self.split, self.ycb_dir, self.mesh, self.mass)


Objects = Annotated[ObjectSet, tyro.conf.OmitArgPrefixes]
"""As options of a command: --split, --ycb-dir, --mesh, --mass."""
