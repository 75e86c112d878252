"""What the catalogue holds, in short: quick, because nothing is cut into convex parts for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bayesgrasp.meshes.mesh_file import read_mesh
from bayesgrasp.meshes.part_cache import peek
from bayesgrasp.objects import ycb
from bayesgrasp.objects.catalogue import available, load_objects, object_ids
from bayesgrasp.objects.object_asset import ObjectAsset


@dataclass(frozen=True)
class Summary:
    """One line of the catalogue.

    Attributes:
        id: Name in the catalogue.
        source: "household", "procedural", "ycb" or "file".
        split: See `catalogue.SPLITS`.
        mass_kg: Mass at scale 1.
        extents_m: Lengths of the bounding box along the axes of the object frame (of the file where not yet settled).
        parts: Number of convex parts; None where they were not made yet.
    """

    id: str
    source: str
    split: str
    mass_kg: float
    extents_m: tuple[float, float, float]
    parts: int | None


def summarise(which: str | Sequence[str] = "all", ycb_dir: Path | None = None) -> list[Summary]:
    """Summaries of objects by split or by id (see `catalogue.load_objects`).

    Raises:
        AssetError: A name is unknown, the directory is missing, or a scan cannot be used.
    """
    root = ycb.directory(ycb_dir)
    splits = available(root)
    scans = {} if root is None else ycb.scans(root)
    return [
        _scan(name, splits[name], scans[name]) if name in scans else _recipe(name) for name in object_ids(which, root)
    ]


def summary_of(asset: ObjectAsset) -> Summary:
    """The line of an object that is loaded, whose convex parts are there."""
    x, y, z = (round(float(length), 4) for length in asset.extents)
    return Summary(asset.id, asset.source, asset.split, asset.mass_kg, (x, y, z), len(asset.parts))


def _recipe(name: str) -> Summary:
    (asset,) = load_objects(name)
    return summary_of(asset)


def _scan(name: str, split: str, path: Path) -> Summary:
    mesh = read_mesh(path)
    resting = peek(mesh)
    vertices = mesh.vertices if resting is None else resting.place(mesh.vertices)
    x, y, z = (round(float(length), 4) for length in np.ptp(vertices, axis=0))
    return Summary(name, "ycb", split, ycb.mass_of(name), (x, y, z), None if resting is None else len(resting.parts))
