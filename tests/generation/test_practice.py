"""Practice: the hands of a scene come from its image alone, and are tried on the object that the image shows."""

from dataclasses import replace
from pathlib import Path

import fake_world
import numpy as np
import pytest
import torch

from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.generation.pool import InProcess
from bayesgrasp.generation.practice import PracticeRecipe, Proposer
from bayesgrasp.generation.run import Run, open_store
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import Attempts, Hands

TRIES, SCENES = 6, 25
CONFIG = replace(fake_world.SMALL, proposal="prior", attempts_per_draw=TRIES, draws_per_chunk=8)


def from_image() -> Proposer:
    """The fake image carries the object's x; the hand goes there."""
    return lambda shown, count, rng: hands_at(shown.images[:, 30, 5] - 0.6, count, rng)


def from_object() -> Proposer:
    """The object's x is known, and the friction too: the hand goes to their sum."""
    return lambda shown, count, rng: hands_at(shown.scenes.object_pose[:, 0] + 0.01 * shown.friction, count, rng)


def hands_at(x: np.ndarray, count: int, rng: np.random.Generator) -> Hands:
    hands = GraspPrior().sample(len(x) * count, rng)
    position = hands.position.reshape(len(x), count, 3)
    position[..., 0] = torch.from_numpy(x)[:, None]
    return Hands(position, hands.rotation.reshape(len(x), count, 3, 3), hands.grasp_type.reshape(-1, count))


@pytest.fixture(scope="module")
def practised(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("practice") / "data"
    make(directory)
    return directory


def make(directory: Path) -> None:
    recipe = PracticeRecipe(fake_world.build, CONFIG, 3, ScenePrior(fake_world.OBJECTS), from_image)
    store = open_store(directory, fake_world.manifest(TRIES * SCENES, seed=3), resume=False)
    Run(store, recipe, TRIES * SCENES).execute(InProcess())


def test_every_scene_has_its_tries(practised: Path) -> None:
    columns = GraspDataset(practised).scene_columns
    assert columns["hand_position"].shape == (SCENES, TRIES, 3)
    assert len(set(columns["draw"])) == SCENES
    np.testing.assert_array_equal(columns["hand_weight"], 0.0)
    np.testing.assert_array_equal(columns["hand_selection_weight"], 1.0)


def test_hands_follow_their_own_image(practised: Path) -> None:
    columns = GraspDataset(practised).scene_columns
    x = np.repeat(columns["object_pose"][:, :1], TRIES, axis=1)
    np.testing.assert_allclose(columns["hand_position"][..., 0], x, atol=1e-4)
    assert np.ptp(x) > 0.05


def test_outcomes_are_of_the_object_in_the_image(practised: Path) -> None:
    columns = GraspDataset(practised).scene_columns

    def flat(name: str) -> np.ndarray:
        return columns[f"hand_{name}"].reshape(SCENES * TRIES, *columns[f"hand_{name}"].shape[2:])

    names = ("position", "quaternion", "grasp_type", "lateral_friction", "spinning_friction", "mass_factor")
    scene = {name: np.repeat(columns[name], TRIES, axis=0) for name in ("object_index", "scale", "object_pose")}
    attempts = Attempts(**{name: flat(name) for name in names}, **scene)
    outcome = fake_world.lift_test(attempts)
    np.testing.assert_array_equal(flat("outcome"), outcome)
    assert len(set(outcome)) > 1


def test_an_object_s_hands_share_the_friction_that_they_were_proposed_for(tmp_path: Path) -> None:
    recipe = PracticeRecipe(fake_world.build, CONFIG, 3, ScenePrior(fake_world.OBJECTS), from_object, "object")
    store = open_store(tmp_path, fake_world.manifest(TRIES * SCENES, seed=3), resume=False)
    Run(store, recipe, TRIES * SCENES).execute(InProcess())
    columns = GraspDataset(tmp_path).scene_columns
    friction = columns["hand_lateral_friction"]
    assert (friction == friction[:, :1]).all()
    assert len(np.unique(friction)) == SCENES
    expected = columns["object_pose"][:, :1] + 0.01 * friction
    np.testing.assert_allclose(columns["hand_position"][..., 0], expected, atol=1e-6)


def test_a_set_says_what_its_hands_were_proposed_from() -> None:
    manifest = fake_world.manifest()
    assert manifest.given == "image"
    assert replace(manifest, config={"practice": {"given": "object"}}).given == "object"


def test_the_same_seed_gives_the_same_records(practised: Path, tmp_path: Path) -> None:
    make(tmp_path / "again")
    for first in sorted(practised.glob("*/*.parquet")):
        again = tmp_path / "again" / first.relative_to(practised)
        assert first.read_bytes() == again.read_bytes()
