"""Loading by split, id and file; the two lists of YCB ids; messages that name what is valid."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from bayesgrasp.errors import AssetError
from bayesgrasp.objects import household, ycb
from bayesgrasp.objects.catalogue import SPLITS, available, load_objects, object_ids
from bayesgrasp.objects.listing import summarise
from bayesgrasp.objects.shapes import box, turned


@pytest.fixture(autouse=True)
def _no_scans_but_those_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(ycb.DIRECTORY_VARIABLE, raising=False)
    monkeypatch.setenv("BAYESGRASP_CACHE_DIR", str(tmp_path / "cache"))


@pytest.fixture
def fake_scans(tmp_path: Path) -> Path:
    """A directory in the official layout with a brick for every id of ours, and one more."""
    first = tmp_path / "ycb" / ycb.TRAIN[0] / "google_16k"
    first.mkdir(parents=True)
    box(0.05, 0.06, 0.07).mesh.to_trimesh().export(first / "nontextured.ply")
    for name in (*ycb.TRAIN[1:], *ycb.UNSEEN, "009_gelatin_box"):
        shutil.copytree(first, tmp_path / "ycb" / name / "google_16k")
    return tmp_path / "ycb"


def test_the_splits_of_ycb_are_19_and_5_and_have_masses() -> None:
    assert len(ycb.TRAIN) == len(set(ycb.TRAIN)) == 19
    assert len(ycb.UNSEEN) == len(set(ycb.UNSEEN)) == 5
    assert not set(ycb.TRAIN) & set(ycb.UNSEEN)
    assert set(ycb.TRAIN + ycb.UNSEEN) <= set(ycb.masses())
    assert ycb.mass_of("003_cracker_box") == 0.411


def test_household_has_five_stand_ins_and_a_dozen_shapes() -> None:
    assert len(household.STAND_INS) == 5
    assert len(household.OBJECTS) >= 12
    assert {asset.id for asset in load_objects("stand-ins")} == set(household.STAND_INS)
    assert all(asset.split == "train" for asset in load_objects("stand-ins"))
    assert all(asset.split == "household" for asset in load_objects("household"))


def test_splits_with_scans(fake_scans: Path) -> None:
    def names(split: str) -> tuple[str, ...]:
        return object_ids(split, fake_scans)

    assert names("train") == ycb.TRAIN + household.STAND_INS
    assert names("train-ycb") == ycb.TRAIN
    assert names("unseen") == ycb.UNSEEN
    assert names("other") == ("009_gelatin_box",)
    assert set(names("all")) == {*ycb.TRAIN, *ycb.UNSEEN, "009_gelatin_box", *household.OBJECTS}


def test_without_scans_all_is_the_household() -> None:
    assert set(object_ids("all", None)) == set(household.OBJECTS)
    with pytest.raises(AssetError, match=r"002_master_chef_can.*--ycb-dir.*objects fetch"):
        load_objects("train")


def test_the_environment_names_the_directory(fake_scans: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ycb.DIRECTORY_VARIABLE, str(fake_scans))
    (asset,) = load_objects("025_mug")
    assert (asset.source, asset.split, asset.mass_kg) == ("ycb", "train", 0.118)
    np.testing.assert_allclose(asset.extents, [0.05, 0.06, 0.07], atol=1e-6)
    np.testing.assert_allclose(asset.center_of_mass, [0, 0, 0.035], atol=1e-6)


def test_order_and_repetition_are_kept(fake_scans: Path) -> None:
    wanted = ["household_egg", "025_mug", "household_egg"]
    assert [asset.id for asset in load_objects(wanted, fake_scans)] == wanted


def test_the_first_mesh_file_there_is_taken(fake_scans: Path) -> None:
    folder = fake_scans / "025_mug" / "google_16k"
    (folder / "nontextured.ply").unlink()
    box(0.05, 0.06, 0.08).mesh.to_trimesh().export(folder / "textured.obj")
    assert ycb.scans(fake_scans)["025_mug"].name == "textured.obj"
    box(0.05, 0.06, 0.09).mesh.to_trimesh().export(folder / "nontextured.stl")
    assert load_objects("025_mug", fake_scans)[0].extents[2] == pytest.approx(0.09, abs=1e-6)


def test_unknown_names_get_the_valid_ones(fake_scans: Path) -> None:
    with pytest.raises(AssetError, match=r"unknown object 'tset'.*household_egg"):
        load_objects("tset")
    with pytest.raises(AssetError, match=r"no scan of '012_strawberry' in .*ycb.*fetch --ids 012_strawberry"):
        load_objects(["025_mug", "012_strawberry"], fake_scans)
    with pytest.raises(AssetError, match="no object was named"):
        load_objects([])
    shutil.rmtree(fake_scans / "009_gelatin_box")
    with pytest.raises(AssetError, match="'other' is empty"):
        load_objects("other", fake_scans)


def test_directories_that_cannot_be_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(AssetError, match=r"gone \(--ycb-dir\) is not there"):
        load_objects("train", tmp_path / "gone")
    (tmp_path / "empty").mkdir()
    with pytest.raises(AssetError, match="holds no scan"):
        load_objects("train", tmp_path / "empty")
    monkeypatch.setenv(ycb.DIRECTORY_VARIABLE, str(tmp_path / "gone"))
    with pytest.raises(AssetError, match=ycb.DIRECTORY_VARIABLE):
        load_objects("train")


def test_a_file_with_a_mass(tmp_path: Path) -> None:
    path = tmp_path / "thing.stl"
    turned([(0.03, 0.0), (0.03, 0.05), (0.01, 0.08), (0.01, 0.1)]).moved(x=1.0, z=-0.5).mesh.to_trimesh().export(path)
    (asset,) = load_objects(mesh=path, mass=0.2)
    assert (asset.id, asset.source, asset.split, asset.mass_kg) == ("thing", "file", "other", 0.2)
    assert asset.vertices[:, 2].min() == pytest.approx(0, abs=5e-4)
    np.testing.assert_allclose(asset.center_of_mass[:2], 0, atol=1e-9)


@pytest.mark.parametrize("mass", [0.0, -1.0, float("nan"), float("inf"), 1e-300, 9e-5, 101.0, 1e300])
def test_a_mass_that_cannot_be(tmp_path: Path, mass: float) -> None:
    box(0.05, 0.05, 0.05).mesh.to_trimesh().export(tmp_path / "cube.stl")
    with pytest.raises(AssetError, match=r"'cube': mass is .* must be from 0.0001 to 100 kg"):
        load_objects(mesh=tmp_path / "cube.stl", mass=mass)
    assert not (tmp_path / "cache").exists()


def test_mesh_and_mass_come_together(tmp_path: Path) -> None:
    for wrong in ({"mesh": tmp_path / "cube.stl"}, {"mass": 0.1}):
        with pytest.raises(AssetError, match="--mesh FILE and --mass KG"):
            load_objects(**wrong)


def test_summaries_do_not_cut(fake_scans: Path) -> None:
    first = summarise("train", fake_scans)
    assert [line.parts for line in first[:19]] == [None] * 19
    assert all(line.parts for line in first[19:])
    load_objects("025_mug", fake_scans)
    assert summarise(["025_mug"], fake_scans)[0].parts == 1
    assert available(None) == {name: household.split_of(name) for name in household.OBJECTS}
    assert "all" in SPLITS
