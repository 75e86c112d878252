"""The catalogue: every object by its id, wherever it comes from, ready for the simulators.

A selection is a split, an id, or several of these joined by ``+``: ``train+procedural:2000@7``. Scenes are drawn evenly
over the objects of a selection, wherever they come from.

| split | objects |
|---|---|
| ``train`` | the 19 YCB training scans and the 5 household stand-ins for the paper's ShapeNet objects (section 4.1) |
| ``train-ycb`` | the 19 YCB training scans only, over which the paper reports its success rates |
| ``unseen`` | the 5 YCB scans kept for testing |
| ``household`` | the household objects that are not stand-ins; needs no files |
| ``stand-ins`` | the 5 household stand-ins; needs no files |
| ``other`` | scans in the YCB directory that belong to no split of ours |
| ``procedural:N@SEED`` | objects 0 to N - 1 of a seed of the generator (`objects/procedural`); needs no files |
| ``all`` | everything available but procedural objects |
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bayesgrasp.errors import AssetError, clipped
from bayesgrasp.meshes.convex import ConvexPart
from bayesgrasp.meshes.decompose import DEFAULT, ConvexConfig
from bayesgrasp.meshes.mass import mass_properties
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.meshes.mesh_file import read_mesh, short
from bayesgrasp.meshes.part_cache import cut_and_settle
from bayesgrasp.meshes.resting import Resting, rest
from bayesgrasp.objects import household, ycb
from bayesgrasp.objects.object_asset import ObjectAsset, check_mass
from bayesgrasp.objects.procedural import numbers, thing

__all__ = ["SPLITS", "ObjectAsset", "available", "load_file", "load_objects", "object_ids"]

SPLITS = ("train", "train-ycb", "unseen", "household", "stand-ins", "other", "all")
VALID = f"the splits {', '.join(SPLITS)} and {numbers.FORM}"


def load_objects(
    which: str | Sequence[str] = "all",
    ycb_dir: Path | str | None = None,
    mesh: Path | str | None = None,
    mass: float | None = None,
    convex: ConvexConfig = DEFAULT,
) -> tuple[ObjectAsset, ...]:
    """Load objects by split or by id, or one mesh file.

    Args:
        which: A split, an id, or several of these joined by ``+`` (an object in two of them is there once), or a
            sequence of splits and ids. The order is kept.
        ycb_dir: Directory of YCB scans; by default ``$BAYESGRASP_YCB_DIR``.
        mesh: A mesh file in metres, z upwards; then it is the only object and ``which`` is not looked at.
        mass: Its mass, kilograms; given if and only if ``mesh`` is.
        convex: How scans are cut into convex parts; the result is kept in the cache.

    Raises:
        AssetError: A name is unknown, the directory is missing, or a mesh or mass cannot be used.
    """
    if mesh is not None or mass is not None:
        if mesh is None or mass is None:
            raise AssetError(
                "a mesh file needs its mass, and a mass its mesh file: give both --mesh FILE and --mass KG"
            )
        return (load_file(Path(mesh), mass, convex),)
    root = ycb.directory(None if ycb_dir is None else Path(ycb_dir))
    scans = {} if root is None else ycb.scans(root)
    return tuple(_load(object_id, scans, convex) for object_id in object_ids(which, root))


def load_file(mesh: Path, mass: float, convex: ConvexConfig = DEFAULT) -> ObjectAsset:
    """Load one object from a mesh file (metres, z upwards) and its mass (kilograms); its id is the file's name.

    Raises:
        AssetError: The mesh or the mass cannot be used.
    """
    check_mass(mass, clipped(mesh.stem, 100))
    surface = read_mesh(mesh)
    return _place(mesh.stem, "file", "other", mass, surface, cut_and_settle(surface, short(mesh), convex))


def available(root: Path | None) -> dict[str, str]:
    """Split of every object that can be loaded, by id: the scans below ``root`` (if any), then household objects."""
    found = {} if root is None else {name: ycb.split_of(name) for name in ycb.scans(root) if name in ycb.masses()}
    return found | {name: household.split_of(name) for name in household.OBJECTS}


def object_ids(which: str | Sequence[str], root: Path | None) -> tuple[str, ...]:
    """Ids of a selection, checked.

    Args:
        which: See `load_objects`.
        root: Directory of YCB scans, or None.

    Raises:
        AssetError: An id or split is unknown, badly formed or not there; the message names the valid ones.
    """
    there = available(root)
    if isinstance(which, str):
        found = (object_id for term in which.split("+") for object_id in _term(term.strip(), there, root))
        return tuple(dict.fromkeys(found))
    if not which:
        raise AssetError(f"no object was named; valid are {VALID}, or ids of objects")
    return tuple(object_id for name in which for object_id in _term(name, there, root))


def _term(term: str, there: dict[str, str], root: Path | None) -> tuple[str, ...]:
    """Ids of one split, or the one id."""
    if term in SPLITS:
        return _split(term, there)
    if (ids := numbers.ids_of(term)) is not None:
        return ids
    if term not in there and numbers.number_of(term) is None:
        raise AssetError(_unknown(term, there, root))
    return (term,)


def _split(split: str, there: dict[str, str]) -> tuple[str, ...]:
    fixed = {
        "train": ycb.TRAIN + household.STAND_INS,
        "train-ycb": ycb.TRAIN,
        "unseen": ycb.UNSEEN,
        "stand-ins": household.STAND_INS,
        "all": tuple(there),
    }
    ids = fixed.get(split, tuple(name for name, its_split in there.items() if its_split == split))
    missing = [object_id for object_id in ids if object_id not in there]
    if missing:
        raise AssetError(
            f"split '{split}' needs YCB scans that are not there: {', '.join(missing)}; name their directory by "
            f"--ycb-dir or {ycb.DIRECTORY_VARIABLE}, and see `bayesgrasp objects fetch`"
        )
    if not ids:
        raise AssetError(f"split '{split}' is empty here: the YCB directory holds no scan outside our splits")
    return ids


def _unknown(object_id: str, there: dict[str, str], root: Path | None) -> str:
    where = f"in {root}" if root else f"(no YCB directory: name one by --ycb-dir or {ycb.DIRECTORY_VARIABLE})"
    if object_id in ycb.masses():
        return f"there is no scan of '{object_id}' {where}; `bayesgrasp objects fetch --ids {object_id}` gets it"
    return f"unknown object '{object_id}'; valid are {VALID}, and the ids {', '.join(there)}"


def _load(object_id: str, scans: dict[str, Path], convex: ConvexConfig) -> ObjectAsset:
    if object_id in household.OBJECTS:
        recipe = household.OBJECTS[object_id]
        solid = recipe.build()
        split = household.split_of(object_id)
        return _place(object_id, "household", split, recipe.mass_kg, solid.mesh, rest(solid.parts))
    if (number := numbers.number_of(object_id)) is not None:
        return thing.make(*number)
    surface = read_mesh(scans[object_id])
    resting = cut_and_settle(surface, short(scans[object_id]), convex)
    return _place(object_id, "ycb", ycb.split_of(object_id), ycb.mass_of(object_id), surface, resting)


def _place(object_id: str, source: str, split: str, mass: float, mesh: Mesh, resting: Resting) -> ObjectAsset:
    """Move mesh and parts from the frame of the file to the object frame."""
    parts = tuple(ConvexPart(resting.place(part.vertices), part.faces) for part in resting.parts)
    center, inertia = mass_properties(parts)
    vertices = resting.place(mesh.vertices)
    return ObjectAsset(object_id, source, split, float(mass), vertices, mesh.faces, parts, center, inertia)
