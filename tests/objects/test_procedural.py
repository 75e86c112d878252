"""Things without end: the same by number, within their bounds, of few convex parts, at rest; and how they are named."""

import pickle
import re

import numpy as np
import pytest
from settling import settle

from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.errors import AssetError
from bayesgrasp.generation.provenance import object_hash
from bayesgrasp.meshes.mesh import Mesh, signed_volume
from bayesgrasp.objects.catalogue import load_objects, object_ids
from bayesgrasp.objects.listing import summarise
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.objects.procedural.kinds import KINDS, SHARES
from bayesgrasp.objects.procedural.numbers import id_of
from bayesgrasp.objects.procedural.thing import make
from bayesgrasp.prior.nuisance import CameraPrior
from bayesgrasp.types import Scenes

SEED = 11
MOST_PARTS, MOST_FACES, MOST_CORNERS = 16, 60, 72


def first_of_each_kind() -> list[ObjectAsset]:
    found: dict[str, int] = {}
    for index in range(2000):
        found.setdefault(id_of(SEED, index).rsplit("-", 2)[0], index)
    return [make(SEED, index) for index in found.values()]


EACH_KIND = first_of_each_kind()


@pytest.fixture(params=EACH_KIND, ids=lambda asset: asset.id)
def thing(request: pytest.FixtureRequest) -> ObjectAsset:
    asset: ObjectAsset = request.param
    return asset


def test_every_kind_is_drawn_as_often_as_its_weight_says() -> None:
    assert {asset.id.rsplit("-", 2)[0] for asset in EACH_KIND} == set(KINDS)
    names = [id_of(3, index).rsplit("-", 2)[0] for index in range(4000)]
    counts = np.array([names.count(name) for name in KINDS])
    expected = 4000 * SHARES
    assert float(((counts - expected) ** 2 / expected).sum()) < 90  # chi^2 with 48 degrees: once in 4,000


def test_sizes_masses_and_parts_are_within_their_bounds(thing: ObjectAsset) -> None:
    assert 0.010 <= thing.mass_kg <= 1.5
    assert thing.extents.max() < 0.36  # a diagonal of what is 25 cm long
    assert len(thing.parts) <= MOST_PARTS
    for part in thing.parts:
        assert signed_volume(part.vertices[part.faces]) > 0
        assert len(part.vertices) <= MOST_CORNERS
    principal = np.linalg.eigvalsh(thing.inertia)
    assert 0 < principal[0] <= principal[2] <= principal[0] + principal[1]


def test_the_mesh_is_the_closed_surfaces_of_the_parts(thing: ObjectAsset) -> None:
    surface = Mesh(thing.vertices, thing.faces).to_trimesh()
    assert surface.is_watertight
    assert surface.is_winding_consistent
    assert surface.body_count == len(thing.parts)


def test_it_stays_where_it_rests(thing: ObjectAsset) -> None:
    assert min(part.vertices[:, 2].min() for part in thing.parts) == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(thing.center_of_mass[:2], 0, atol=1e-9)
    moved, turned = settle(thing)
    assert moved < 1e-3
    assert turned < 2.0


def test_an_object_is_the_same_whatever_is_asked_for_beside_it() -> None:
    alone, among = make(7, 4), load_objects("procedural:6@7")[4]
    (by_id,) = load_objects(alone.id)
    assert object_hash(alone) == object_hash(among) == object_hash(by_id)
    assert alone.id == among.id == by_id.id
    assert object_hash(make(8, 4)) != object_hash(alone)
    assert len({object_hash(asset) for asset in load_objects("procedural:30@7")}) == 30


def test_it_goes_to_other_processes_by_its_number() -> None:
    asset = make(7, 4)
    sent = pickle.dumps(asset)
    assert len(sent) < 120
    back = pickle.loads(sent)
    assert object_hash(back) == object_hash(asset)
    assert (back.id, back.mass_kg) == (asset.id, asset.mass_kg)


def test_the_sensor_sees_it() -> None:
    objects = load_objects("procedural:8@7")
    scenes = Scenes(np.arange(8, dtype=np.int32), np.ones(8, np.float32), np.zeros((8, 3), np.float32))
    rng = np.random.default_rng(0)
    sensor = DepthSensor(objects)
    table = sensor.render_clean(Scenes(scenes.object_index, scenes.scale, np.full((8, 3), 0.5, np.float32)))
    assert (np.abs(sensor.render_clean(scenes, CameraPrior().sample(8, rng)) - table) > 0.005).any(axis=(1, 2)).all()


def test_selections_are_joined() -> None:
    made = object_ids("procedural:3@7", None)
    assert object_ids("household_egg+procedural:3@7", None) == ("household_egg", *made)
    assert object_ids("procedural:3@7+procedural:2@7+household_egg", None) == (*made, "household_egg")
    assert object_ids(["household_egg", "procedural:3@7"], None) == ("household_egg", *made)
    assert object_ids("procedural:2@7", None) == made[:2]


def test_they_can_be_listed() -> None:
    (line,) = summarise(id_of(7, 4))
    assert (line.source, line.split, line.parts) == ("procedural", "procedural", len(make(7, 4).parts))


@pytest.mark.parametrize(
    ("split", "message"),
    [
        ("procedural", r"'procedural' is no split; write procedural:N@SEED, for example procedural:200@7"),
        ("procedural:5", "is no split; write procedural:N@SEED"),
        ("procedural@5", "is no split; write procedural:N@SEED"),
        ("procedural:-5@1", "is no split; write procedural:N@SEED"),
        ("procedural:5@1.5", "is no split; write procedural:N@SEED"),
        ("procedural:" + "9" * 500 + "@1", "is no split; write procedural:N@SEED"),
        ("procedural:0@1", "N must be from 1 to 100000, SEED from 0 to"),
        ("procedural:100001@1", "N must be from 1 to 100000, SEED from 0 to"),
        ("procedural:5@9999999999999999999", "N must be from 1 to 100000, SEED from 0 to"),
        ("household+", r"unknown object ''; valid are the splits train, .* and procedural:N@SEED"),
        ("household+procedural:x@1", "is no split; write procedural:N@SEED"),
    ],
)
def test_bad_selections_are_named(split: str, message: str) -> None:
    with pytest.raises(AssetError, match=message):
        object_ids(split, None)


def test_an_id_with_another_kind_is_refused() -> None:
    true = id_of(7, 4)
    other = next(kind for kind in KINDS if not true.startswith(kind))
    with pytest.raises(
        AssetError, match=re.escape(f"there is no object '{other}-7-4': object 4 of seed 7 is '{true}'")
    ):
        load_objects(f"{other}-7-4")
