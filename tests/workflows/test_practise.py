"""Practice draws from the prior that its model was trained with; a model that knows meshes keeps to them."""

from pathlib import Path

import numpy as np
import pytest
from untrained_model import OBJECTS, save_untrained

from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.errors import CheckpointError, InvalidConfigurationError
from bayesgrasp.objects.catalogue import load_objects
from bayesgrasp.ratio.card import read_card, write_card
from bayesgrasp.workflows.practise import PracticeJob, practise


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model whose prior is not the default one: hands of one type in a slice of the box."""
    directory = save_untrained(tmp_path_factory.mktemp("practise") / "model")
    card = read_card(directory)
    write_card(directory, card | {"prior": card["prior"] | {"z": [0.2, 0.21], "types": [2]}})
    return directory


def test_hands_stay_inside_the_prior_of_the_model(model: Path, tmp_path: Path) -> None:
    told: list[int] = []
    job = PracticeJob(model, load_objects(OBJECTS), scenes=2, tries=3, seed=1)
    manifest = practise(job, tmp_path / "set", progress=lambda progress: told.append(progress.attempts))
    assert told[-1] == job.attempts == manifest.totals["attempts"] == 6
    assert manifest.config["generate"]["grasp"]["z"] == [0.2, 0.21]
    columns = GraspDataset(tmp_path / "set").scene_columns
    height = columns["hand_position"][..., 2]
    assert ((height >= 0.2) & (height <= 0.21)).all()
    np.testing.assert_array_equal(columns["hand_grasp_type"], 2)


def test_an_estimator_that_is_told_the_mesh_refuses_meshes_that_it_never_knew(model: Path, tmp_path: Path) -> None:
    job = PracticeJob(model, load_objects(["household_ball"]), scenes=1, tries=3, estimator="full")
    with pytest.raises(InvalidConfigurationError, match="knows the objects household_carton"):
        practise(job, tmp_path / "set")
    assert not (tmp_path / "set").exists()


def test_a_model_of_another_hand_is_refused_before_anything_is_written(model: Path, tmp_path: Path) -> None:
    other = save_untrained(tmp_path / "model")
    write_card(other, read_card(other) | {"gripper": "robotiq-2f-85", "gripper_sha256": 64 * "0"})
    with pytest.raises(CheckpointError, match="for the gripper 'robotiq-2f-85', not for 'robotiq-3f'"):
        practise(PracticeJob(other, load_objects(OBJECTS), scenes=1, tries=3), tmp_path / "set")
    assert not (tmp_path / "set").exists()


def test_too_little_practice_is_refused(model: Path) -> None:
    with pytest.raises(InvalidConfigurationError, match="3 tries"):
        PracticeJob(model, load_objects(OBJECTS), tries=2)


def test_exploration_needs_an_image_and_room(model: Path) -> None:
    objects = load_objects(OBJECTS)
    with pytest.raises(InvalidConfigurationError, match="at least 3, got 2 of 4"):
        PracticeJob(model, objects, tries=4, explore=2)
    with pytest.raises(InvalidConfigurationError, match="full looks at no image"):
        PracticeJob(model, objects, estimator="full", explore=12)
