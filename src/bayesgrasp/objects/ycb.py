"""The YCB Object and Model Set (Calli et al. 2015, CC BY 4.0): ids, official masses, and where scans are found.

The layout is that of the official archives, ``<id>/google_16k/nontextured.ply``; the scans themselves are not part of
the package. The paper trains on 19 YCB objects and tests on 5 more, but does not name them: these are ours.
"""

from __future__ import annotations

import json
import os
from functools import cache
from importlib.resources import files
from pathlib import Path

from bayesgrasp.errors import AssetError

DIRECTORY_VARIABLE = "BAYESGRASP_YCB_DIR"
MESH_FILES = ("nontextured.ply", "nontextured.stl", "textured.obj")

TRAIN = (
    "002_master_chef_can",
    "003_cracker_box",
    "004_sugar_box",
    "005_tomato_soup_can",
    "006_mustard_bottle",
    "007_tuna_fish_can",
    "008_pudding_box",
    "010_potted_meat_can",
    "011_banana",
    "013_apple",
    "019_pitcher_base",
    "021_bleach_cleanser",
    "024_bowl",
    "025_mug",
    "035_power_drill",
    "036_wood_block",
    "056_tennis_ball",
    "061_foam_brick",
    "077_rubiks_cube",
)
UNSEEN = ("016_pear", "022_windex_bottle", "053_mini_soccer_ball", "055_baseball", "065-j_cups")


@cache
def masses() -> dict[str, float]:
    """Official masses by id, kilograms; bottles are full."""
    text = files("bayesgrasp.objects").joinpath("data/ycb_masses.json").read_text()
    found: dict[str, float] = json.loads(text)
    return found


def split_of(object_id: str) -> str:
    """Split of a YCB object: "train", "unseen", or "other"."""
    return "train" if object_id in TRAIN else "unseen" if object_id in UNSEEN else "other"


def directory(named: Path | None = None) -> Path | None:
    """The directory of scans: the one named, else ``$BAYESGRASP_YCB_DIR``, else None.

    Raises:
        AssetError: The directory is not there, or holds no scan.
    """
    chosen = named if named is not None else Path(value) if (value := os.environ.get(DIRECTORY_VARIABLE)) else None
    if chosen is None:
        return None
    chosen = chosen.expanduser()
    where = "--ycb-dir" if named is not None else DIRECTORY_VARIABLE
    if not chosen.is_dir():
        raise AssetError(f"the YCB directory {chosen} ({where}) is not there; `bayesgrasp objects fetch` makes one")
    if not scans(chosen):
        raise AssetError(f"{chosen} ({where}) holds no scan; expected <id>/google_16k/{MESH_FILES[0]}")
    return chosen


def scans(root: Path) -> dict[str, Path]:
    """Mesh files by object id, in the order of the ids; where an object has several, the first of `MESH_FILES`."""
    found = {}
    for folder in sorted(root.glob("*/google_16k")):
        files_there = [folder / name for name in MESH_FILES if (folder / name).is_file()]
        if files_there:
            found[folder.parent.name] = files_there[0]
    return found


def mass_of(object_id: str) -> float:
    """Official mass, kilograms.

    Raises:
        AssetError: There is no official mass for this id.
    """
    if object_id not in masses():
        raise AssetError(f"there is no official mass for '{object_id}'; load it with --mesh FILE --mass KG instead")
    return masses()[object_id]
