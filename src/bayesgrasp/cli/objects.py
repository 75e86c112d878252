"""``bayesgrasp objects list | show | fetch``: what can be grasped, what it looks like, and where scans come from."""

from __future__ import annotations

from dataclasses import asdict
from math import ceil, sqrt
from pathlib import Path
from statistics import median
from typing import Annotated, Literal

import numpy as np
import tyro
from jaxtyping import UInt8
from PIL import Image

from bayesgrasp.cli.progress import downloading
from bayesgrasp.errors import AssetError, clipped
from bayesgrasp.files import check_target, write_json, write_through
from bayesgrasp.meshes.decompose import PRESETS
from bayesgrasp.meshes.deviation import deviation
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.objects import ycb
from bayesgrasp.objects.catalogue import load_objects, object_ids
from bayesgrasp.objects.fetch import FetchConfig
from bayesgrasp.objects.fetch import fetch as fetch_one
from bayesgrasp.objects.listing import Summary, summarise, summary_of
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.viewer.object_picture import object_picture, objects_picture

MOST_DRAWN = 400
"""Objects in one picture."""


def list_objects(split: str = "all", ycb_dir: Path | None = None, json: Path | None = None) -> None:
    """List the objects of the catalogue.

    Args:
        split: Which objects: train (19 YCB scans and 5 household stand-ins), train-ycb (the 19 only), unseen (5 YCB
            scans), household, stand-ins, other (scans outside our splits), procedural:N@SEED (made objects), all
            scans and household shapes that are there, one id, or several of these joined by +.
        ycb_dir: Directory of YCB scans, <id>/google_16k/nontextured.ply; by default $BAYESGRASP_YCB_DIR.
        json: Also write the list to this file.
    """
    summaries = summarise(split, ycb_dir)
    print("\n".join(_table(summaries)))
    if json is not None:
        write_json(json, [asdict(summary) for summary in summaries])


def show(
    id: Annotated[str | None, tyro.conf.Positional] = None,
    ycb_dir: Path | None = None,
    mesh: Path | None = None,
    mass: float | None = None,
    convex: Literal["default", "paper"] = "default",
    split: str | None = None,
    out: Path | None = None,
    json: Path | None = None,
) -> None:
    """Describe one object and draw it, its mesh and its convex parts, or draw all objects of a split.

    Args:
        id: Which object, as `bayesgrasp objects list` names it.
        ycb_dir: Directory of YCB scans; by default $BAYESGRASP_YCB_DIR.
        mesh: A mesh file of your own instead (.ply, .stl, .obj, .off), in metres with z upwards.
        mass: Its mass in kilograms.
        convex: How the mesh is cut into convex parts: by CoACD (default) or by V-HACD (paper).
        split: Draw these objects instead, at most 400, as `bayesgrasp objects list` takes them.
        out: The picture, .png; by default <id>.png, or objects.png, here.
        json: Also write the description to this file, for all objects of a split a list.
    """
    if json is not None:
        check_target(json)
    if split is not None:
        assets = _several(id, mesh, mass, split, ycb_dir, convex)
        _show_all(assets, out or Path("objects.png"))
        if json is not None:
            write_json(json, [asdict(summary_of(asset)) for asset in assets])
        return
    asset = _one(id, ycb_dir, mesh, mass, convex)
    target = out or Path(f"{asset.id}.png")
    check_target(target)
    print("\n".join(_description(asset)))
    _save(object_picture(asset), target)
    if json is not None:
        write_json(json, asdict(summary_of(asset)))


def _show_all(assets: tuple[ObjectAsset, ...], target: Path) -> None:
    check_target(target)
    masses, sides = [asset.mass_kg for asset in assets], [1000 * float(asset.extents.max()) for asset in assets]
    print(f"objects      {len(assets)}, {sum(len(asset.parts) for asset in assets) / len(assets):.1f} parts each")
    print(f"mass         {min(masses):.3f} to {max(masses):.3f} kg, half of them below {median(masses):.3f}")
    print(f"length       {min(sides):.0f} to {max(sides):.0f} mm, half of them below {median(sides):.0f}")
    _save(objects_picture(assets, ceil(sqrt(len(assets)))), target)


def _save(picture: UInt8[np.ndarray, "h w 3"], target: Path) -> None:
    image = Image.fromarray(picture)
    write_through(target, lambda file: image.save(file, format="PNG", optimize=True))
    print(f"picture      {target}")


def fetch(
    ycb_dir: Path,
    ids: tuple[str, ...] = (),
    split: Literal["train", "unseen", "both"] = "both",
    base_url: str | None = None,
) -> None:
    """Download YCB scans from the official archives.

    An interrupted download goes on when the command is run again; scans that are there are left alone.

    Args:
        ycb_dir: Where to put them, as <id>/google_16k/.
        ids: Which objects; by default those of the split.
        split: The 19 YCB objects for training, the 5 unseen ones, or both.
        base_url: Another address than the official one, above google/<id>_google_16k.tgz.
    """
    chosen = ids or {"train": ycb.TRAIN, "unseen": ycb.UNSEEN, "both": ycb.TRAIN + ycb.UNSEEN}[split]
    config = FetchConfig() if base_url is None else FetchConfig(base_url=base_url)
    failed = _fetch_each(chosen, ycb_dir, config)
    print(f"{len(chosen) - len(failed)} of {len(chosen)} scans are in {ycb_dir}")
    if failed:
        raise AssetError("\n       ".join(failed))


def _fetch_each(ids: tuple[str, ...], root: Path, config: FetchConfig) -> list[str]:
    """Fetch one after the other behind a progress bar; returns what went wrong, one line each."""
    failed = []
    with downloading() as begin:
        for object_id in ids:
            try:
                fetch_one(object_id, root, config, begin(object_id))
            except AssetError as error:
                failed.append(str(error))
    return failed


def _one(id: str | None, ycb_dir: Path | None, mesh: Path | None, mass: float | None, convex: str) -> ObjectAsset:
    if (id is None) == (mesh is None):
        raise AssetError(
            "name either one object, or a file: `objects show ID`, or `objects show --mesh FILE --mass KG`"
        )
    found = load_objects([id] if id is not None else (), ycb_dir, mesh, mass, PRESETS[convex])
    return found[0]


def _several(
    id: str | None, mesh: Path | None, mass: float | None, split: str, ycb_dir: Path | None, convex: str
) -> tuple[ObjectAsset, ...]:
    if id is not None or mesh is not None or mass is not None:
        raise AssetError("name one object, or a file, or a split: --split goes with none of ID, --mesh and --mass")
    if (count := len(object_ids(split, ycb.directory(ycb_dir)))) > MOST_DRAWN:
        raise AssetError(f"'{clipped(split, 60)}' is {count} objects; at most {MOST_DRAWN} are drawn in one picture")
    return load_objects(split, ycb_dir, convex=PRESETS[convex])


def _table(summaries: list[Summary]) -> list[str]:
    width = max(len(summary.id) for summary in summaries)
    lines = [f"{'id':{width}}  {'source':10}  {'split':10}  {'mass kg':>7}  {'extents mm':>17}  parts"]
    for s in summaries:
        extents = " x ".join(f"{1000 * length:.0f}" for length in s.extents_m)
        parts = "-" if s.parts is None else str(s.parts)
        lines.append(f"{s.id:{width}}  {s.source:10}  {s.split:10}  {s.mass_kg:7.3f}  {extents:>17}  {parts:>5}")
    if any(summary.parts is None for summary in summaries):
        lines.append("- : not cut into convex parts yet; that happens once, at first use")
    return lines


def _description(asset: ObjectAsset) -> list[str]:
    found = deviation(Mesh(asset.vertices, asset.faces), asset.parts)
    usual, most, gap = (f"{1000 * length:.1f} mm" for length in (found.excess_99, found.excess_max, found.gap_max))
    extents = " x ".join(f"{1000 * length:.1f}" for length in asset.extents)
    corners = sum(len(part.vertices) for part in asset.parts)
    return [
        f"object       {asset.id} ({asset.source}, split {asset.split})",
        f"mass         {asset.mass_kg:.4g} kg, centre at height {1000 * asset.center_of_mass[2]:.1f} mm",
        f"mesh         {len(asset.vertices)} vertices, {len(asset.faces)} faces, {extents} mm at rest",
        f"parts        {len(asset.parts)} convex, {corners} corners",
        f"deviation    parts outside the mesh by {usual} (99 %), {most} at most; mesh outside them by {gap} at most",
    ]
