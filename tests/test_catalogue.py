"""One smoke test over everything that can be grasped: registering an object tests it."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from settling import settle

from bayesgrasp.meshes.deviation import deviation
from bayesgrasp.meshes.mesh import Mesh, signed_volume
from bayesgrasp.meshes.mesh_file import read_mesh
from bayesgrasp.meshes.part_cache import peek
from bayesgrasp.objects import household, ycb
from bayesgrasp.objects.catalogue import ObjectAsset, load_objects

SHARED = Path(__file__).parents[2] / "shared" / "objects" / "ycb"
SCANS = ycb.scans(SHARED) if SHARED.is_dir() else {}
# Cut in a second or two; the others take up to half a minute each and are tested where the cache has them.
QUICK = (
    "004_sugar_box",
    "007_tuna_fish_can",
    "008_pudding_box",
    "016_pear",
    "036_wood_block",
    "053_mini_soccer_ball",
    "055_baseball",
    "056_tennis_ball",
)
HOLLOW = {"024_bowl": 0.045, "025_mug": 0.06, "065-j_cups": 0.06}  # heights in the open cavity, metres
MAX_PARTS, MAX_CORNERS = 32, 200


@cache
def scan_ready(name: str) -> bool:
    return name in QUICK or peek(read_mesh(SCANS[name])) is not None


@cache
def load(name: str) -> ObjectAsset:
    if name in SCANS and not scan_ready(name):
        pytest.skip(f"{name} is not in the cache; `bayesgrasp objects show {name}` puts it there")
    (asset,) = load_objects([name], SHARED if name in SCANS else None)
    return asset


def test_the_scans_are_here(ycb_dir: Path) -> None:
    assert set(ycb.TRAIN + ycb.UNSEEN) <= set(ycb.scans(ycb_dir))


@pytest.fixture(params=[*household.OBJECTS, *SCANS])
def asset(request: pytest.FixtureRequest) -> ObjectAsset:
    return load(request.param)


def test_it_is_finite_and_has_a_mass(asset: ObjectAsset) -> None:
    assert 0.001 < asset.mass_kg < 3
    for array in (asset.vertices, asset.center_of_mass, asset.inertia, *(part.vertices for part in asset.parts)):
        assert np.isfinite(array).all()
    assert 0.03 < asset.extents.max() < 0.3
    principal = np.linalg.eigvalsh(asset.inertia)
    assert principal[0] > 0
    assert principal[2] <= principal[0] + principal[1]


def test_it_rests_on_the_plane_below_its_centre_of_mass(asset: ObjectAsset) -> None:
    assert abs(min(part.vertices[:, 2].min() for part in asset.parts)) < 1e-9
    assert abs(asset.vertices[:, 2].min()) < 1.2e-3
    np.testing.assert_allclose(asset.center_of_mass[:2], 0, atol=1e-9)
    assert 0 < asset.center_of_mass[2] < asset.extents[2]


def test_its_parts_are_few_convex_and_wound_outwards(asset: ObjectAsset) -> None:
    assert len(asset.parts) <= MAX_PARTS
    for part in asset.parts:
        normals, offsets = part.halfspaces()
        assert float((part.vertices @ normals.T - offsets).max()) < 1e-9
        assert signed_volume(part.vertices[part.faces]) > 0
        assert len(part.vertices) <= MAX_CORNERS


def test_its_parts_cover_the_mesh_and_little_more(asset: ObjectAsset) -> None:
    found = deviation(Mesh(asset.vertices, asset.faces), asset.parts, points=2000)
    assert found.gap_max < 0.0025
    assert found.excess_99 < 0.006
    assert found.excess_max < 0.009


@pytest.mark.parametrize("name", [name for name in HOLLOW if name in SCANS])
def test_what_is_hollow_stays_hollow(name: str) -> None:
    asset = load(name)
    middle = (asset.vertices.min(axis=0) + asset.vertices.max(axis=0)) / 2
    point = np.array([[middle[0], middle[1], HOLLOW[name]]])
    if name == "025_mug":
        point[0, :2] = 0  # the handle moves the middle of the box
    assert min(float(part.depth(point)[0]) for part in asset.parts) > 0.015


def test_it_stays_where_it_rests_in_the_physics_engine(asset: ObjectAsset) -> None:
    moved, turned = settle(asset)
    assert moved < 5e-4
    assert turned < 1.0
