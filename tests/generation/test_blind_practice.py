"""Practice without an image: hands know nothing of their scenes, and every hand has a scene of its own."""

from pathlib import Path

import fake_world
import numpy as np
import pytest

from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.errors import DataError
from bayesgrasp.generation.blind_practice import BlindProposer, BlindRecipe
from bayesgrasp.generation.chunks import GenerateConfig
from bayesgrasp.generation.pool import InProcess
from bayesgrasp.generation.run import Run, open_store
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import Attempts

TRIES = 200
CONFIG = GenerateConfig(attempts_per_draw=1, scenes_per_draw=0, draws_per_chunk=64)
NARROW = GraspPrior(x=(-0.02, 0.02), y=(-0.02, 0.02), z=(0.15, 0.19))


def near_the_axis() -> BlindProposer:
    return NARROW.sample


def make(directory: Path) -> GraspDataset:
    recipe = BlindRecipe(fake_world.build, CONFIG, 3, ScenePrior(fake_world.OBJECTS), near_the_axis)
    Run(open_store(directory, fake_world.manifest(TRIES, seed=3), False), recipe, TRIES).execute(InProcess())
    return GraspDataset(directory)


@pytest.fixture(scope="module")
def practised(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    return make(tmp_path_factory.mktemp("practice") / "data")


def test_every_hand_has_a_scene_and_a_draw_of_its_own(practised: GraspDataset) -> None:
    columns = practised.attempt_columns
    assert len(np.unique(columns["draw"])) == len(np.unique(columns["object_pose"], axis=0)) == TRIES
    assert np.unique(columns["object_index"]).tolist() == list(range(fake_world.OBJECTS))
    assert (np.abs(columns["position"][:, :2]) <= 0.02).all()


def test_outcomes_are_those_of_the_lift_test(practised: GraspDataset) -> None:
    columns = practised.attempt_columns
    attempts = Attempts(**{name: np.array(columns[name]) for name in Attempts.__dataclass_fields__})
    np.testing.assert_array_equal(fake_world.lift_test(attempts), columns["outcome"])
    assert len(np.unique(columns["outcome"])) > 1


def test_it_has_no_density_and_no_images(practised: GraspDataset) -> None:
    assert np.isneginf(practised.attempt_columns["log_weight"]).all()
    with pytest.raises(DataError, match="no images"):
        _ = practised.scene_columns


def test_the_same_seed_gives_the_same_records(practised: GraspDataset, tmp_path: Path) -> None:
    again = make(tmp_path / "again").attempt_columns
    for name, column in practised.attempt_columns.items():
        np.testing.assert_array_equal(column, again[name])
