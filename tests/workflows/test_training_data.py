"""What each estimator learns from: attempts, scenes, and only the practice whose hands knew no more than it is told."""

from dataclasses import replace
from pathlib import Path

import fake_world
import pytest
from training_set import CONFIG, MANIFEST, make_training_set

from bayesgrasp.data.attempts import RefreshedAttempts
from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.data.manifest import Manifest
from bayesgrasp.errors import DataError
from bayesgrasp.generation.chunks import GenerateConfig
from bayesgrasp.ratio.model import Role
from bayesgrasp.training.presets import PresetName, Setup, preset
from bayesgrasp.workflows.training_data import sources_by_role

SMALL = GenerateConfig(proposal="prior", attempts_per_draw=16, scenes_per_draw=1, draws_per_chunk=20)


def made(directory: Path, manifest: Manifest = MANIFEST) -> GraspDataset:
    return GraspDataset(make_training_set(directory, 16 * 60, SMALL, manifest))


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    return made(tmp_path_factory.mktemp("base") / "data")


@pytest.fixture(scope="module")
def practice(tmp_path_factory: pytest.TempPathFactory) -> list[GraspDataset]:
    """One set whose hands knew the image, one whose hands knew the object, one on a fourth object too."""
    directory = tmp_path_factory.mktemp("practice")
    told = replace(MANIFEST, config=CONFIG | {"practice": {"given": "object"}})
    more = replace(
        MANIFEST, objects=[*MANIFEST.objects, {"id": "copy", "sha256": "", "split": "train", "mass_kg": 0.1}]
    )
    return [made(directory / str(number), manifest) for number, manifest in enumerate((MANIFEST, told, more))]


@pytest.fixture(scope="module")
def blind(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    """Practice whose hands knew nothing; its 20 draws a chunk are enough for all splits."""
    manifest = replace(MANIFEST, config=CONFIG | {"practice": {"given": "nothing"}})
    return made(tmp_path_factory.mktemp("blind") / "data", manifest)


def test_the_data_of_an_estimator_are_named_by_all_its_files(base: GraspDataset, practice: list[GraspDataset]) -> None:
    """So that a saved state does not go on with other data of the same size."""
    parts = preset("paper", Setup(objects=fake_world.OBJECTS), ("image",))
    sets = (base, []), (practice[2], []), (base, practice[:1]), (base, practice[2:])
    named = [sources_by_role(parts, one, more, 4, 0)["image"].identity for one, more in sets]
    assert len({*named, ""}) == 5
    assert named[0] == sources_by_role(parts, GraspDataset(base.store.directory), [], 4, 0)["image"].identity


def batches(base: GraspDataset, practice: list[GraspDataset], role: Role) -> int:
    parts = preset("best", Setup(objects=fake_world.OBJECTS), (role,))
    return len(sources_by_role(parts, base, practice, 4, 0)[role].training)


def test_the_ratio_of_success_alone_learns_from_attempts(base: GraspDataset) -> None:
    parts = preset("best", Setup(), ("success_ratio",))
    found = sources_by_role(parts, base, (), 4, 0)["success_ratio"]
    assert isinstance(found.training, RefreshedAttempts)
    assert isinstance(found.held_out, RefreshedAttempts)


@pytest.mark.parametrize("preset_name", ["best", "paper"])
def test_blind_practice_teaches_p_of_success_given_the_hand_alone(
    base: GraspDataset, blind: GraspDataset, preset_name: PresetName
) -> None:
    """The paper's d_phi needs draws from p(h), and what sees an image must not learn from hands without one."""
    parts = preset(preset_name, Setup(), ("success_ratio",))
    alone, both = (sources_by_role(parts, base, sets, 4, 0)["success_ratio"] for sets in ([], [blind]))
    assert len(both.training) - len(alone.training) == (preset_name == "best")
    assert len(both.held_out) - len(alone.held_out) == (preset_name == "best")
    assert batches(base, [blind], "success") == batches(base, [], "success")
    assert batches(base, [blind], "full") == batches(base, [], "full")


@pytest.mark.parametrize(("role", "times"), [("image", 1), ("joint", 1), ("success", 3), ("full", 4)])
def test_practice_goes_where_it_is_right(
    base: GraspDataset, practice: list[GraspDataset], role: Role, times: int
) -> None:
    """Ratios of densities learn from none, p(S=1 | i, h) not from hands that knew the object, `full` from all."""
    assert batches(base, practice, role) == times * batches(base, [], role)


def test_an_estimator_told_the_mesh_refuses_practice_with_other_meshes(base: GraspDataset, tmp_path: Path) -> None:
    other = made(tmp_path / "other", replace(MANIFEST, objects=MANIFEST.objects[::-1]))
    assert batches(base, [other], "success") > batches(base, [], "success")
    with pytest.raises(DataError, match="other objects"):
        batches(base, [other], "full")
