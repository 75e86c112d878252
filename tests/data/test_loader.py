"""Batches from a data set: complete, shuffled the same way for the same seed, split by draw."""

from collections.abc import Callable
from pathlib import Path

import fake_world
import numpy as np
import pytest
import torch

from bayesgrasp.data.loader import GraspDataset, in_split
from bayesgrasp.data.schema import Batch
from bayesgrasp.data.store import Store
from bayesgrasp.errors import DataError, InvalidConfigurationError
from bayesgrasp.generation.chunks import GenerateConfig
from bayesgrasp.generation.pool import InProcess
from bayesgrasp.generation.run import Run, open_store

CONFIG = GenerateConfig(proposal="prior", attempts_per_draw=16, scenes_per_draw=2, draws_per_chunk=10)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    directory = tmp_path_factory.mktemp("set") / "data"
    store = open_store(directory, fake_world.manifest(), False)
    Run(store, fake_world.recipe(CONFIG), 16 * 40).execute(InProcess())
    return GraspDataset(directory)


def keys(batch: Batch) -> set[tuple[float, ...]]:
    return {tuple(row) for row in batch.object_pose.tolist()}


def test_an_epoch_holds_every_scene_of_the_split_once(dataset: GraspDataset) -> None:
    loader = dataset.scenes("train", batch_size=7)
    batches = list(loader.batches(0))
    assert len(batches) == len(loader) == -(-72 // 7)
    seen = [key for batch in batches for key in keys(batch)]
    assert len(seen) == len(set(seen)) == 72
    order = [tuple(row) for batch in loader.batches(1) for row in batch.object_pose.tolist()]
    assert sorted(order) == sorted(seen)
    assert order != [tuple(row) for batch in batches for row in batch.object_pose.tolist()]


def test_an_epoch_is_the_same_when_asked_again(dataset: GraspDataset) -> None:
    first, second = (next(iter(dataset.scenes("train", 8, seed=3).batches(5))) for _ in range(2))
    assert torch.equal(first.images, second.images)
    assert torch.equal(first.hands.rotation, second.hands.rotation)


def test_splits_share_no_draw_and_cover_all(dataset: GraspDataset) -> None:
    draws = dataset.scene_columns["draw"]
    parts = [set(draws[in_split(draws, split)].tolist()) for split in ("train", "validation", "test")]
    assert all(parts)
    assert not parts[0] & parts[1]
    assert not parts[0] & parts[2]
    assert not parts[1] & parts[2]
    assert set.union(*parts) == set(draws.tolist())
    attempts = dataset.attempt_columns["draw"]
    assert set(attempts[in_split(attempts, "test")].tolist()) == parts[2]


def test_a_batch_is_what_was_stored(dataset: GraspDataset) -> None:
    chunk = Store(dataset.store.directory).chunk(0)
    batch = next(iter(dataset.scenes("all", batch_size=4, shuffle=False).batches(0)))
    assert batch.images.shape == (4, 1, 160, 256)
    stored = chunk.scenes.image[:4].astype(np.float32) * np.float32(1e-4)
    np.testing.assert_array_equal(batch.images[:, 0].numpy(), stored)
    np.testing.assert_array_equal(batch.success.numpy(), (chunk.hands.outcome[:4] == 4).astype(np.float32))
    np.testing.assert_array_equal(batch.weight.numpy(), chunk.hands.weight[:4])
    np.testing.assert_array_equal(batch.hands.position.numpy(), chunk.hands.position[:4])
    np.testing.assert_array_equal(batch.object_pose.numpy(), chunk.scenes.object_pose[:4])


def test_padding_is_a_hand_without_weight(dataset: GraspDataset) -> None:
    """A draw of 16 attempts fills 16 of the 32 places."""
    batch = next(iter(dataset.scenes("train", batch_size=8).batches(0)))
    padding = (batch.weight == 0) & (batch.hands.position == 0).all(-1)
    assert padding.sum() >= 8 * 16
    assert (batch.selection_weight[padding] == 0).all()
    assert (batch.success[padding] == 0).all()
    identity = torch.eye(3).expand(*batch.hands.shape, 3, 3)
    assert torch.allclose(batch.hands.rotation @ batch.hands.rotation.mT, identity, atol=1e-5)


def test_attempts_of_an_epoch_are_all_there_once(dataset: GraspDataset) -> None:
    loader = dataset.attempts("train", batch_size=100)
    batches: list[Batch] = list(loader.batches(0))
    rows = torch.cat([b.hands.position for b in batches])
    assert len(rows) == 36 * 16
    assert len(torch.unique(rows, dim=0)) == len(rows)
    again = torch.cat([b.hands.position for b in loader.batches(0)])
    other = torch.cat([b.hands.position for b in loader.batches(1)])
    assert torch.equal(rows, again)
    assert not torch.equal(rows, other)
    assert (torch.cat([b.weight for b in batches]) == 1).all()


def test_the_cache_is_made_once_and_again_for_more_data(dataset: GraspDataset, tmp_path: Path) -> None:
    store = open_store(tmp_path / "data", fake_world.manifest(), False)
    Run(store, fake_world.recipe(CONFIG), 160).execute(InProcess())
    first = GraspDataset(tmp_path / "data", tmp_path / "cache")
    assert len(first.scene_columns["draw"]) == 20
    stamp = (tmp_path / "cache").stat().st_mtime_ns
    assert len(GraspDataset(tmp_path / "data", tmp_path / "cache").scene_columns["draw"]) == 20
    assert (tmp_path / "cache").stat().st_mtime_ns == stamp
    Run(store, fake_world.recipe(CONFIG), 320).execute(InProcess())
    assert len(GraspDataset(tmp_path / "data", tmp_path / "cache").scene_columns["draw"]) == 40
    assert not list((tmp_path / "cache").glob("*.part"))


def test_images_stay_on_disk(dataset: GraspDataset) -> None:
    assert all(isinstance(column, np.memmap) for column in dataset.scene_columns.values())


def empty(directory: Path) -> None:
    open_store(directory, fake_world.manifest(), False)


def without_images(directory: Path) -> None:
    store = open_store(directory, fake_world.manifest(), False)
    config = GenerateConfig(proposal="prior", attempts_per_draw=16, scenes_per_draw=0, draws_per_chunk=1)
    Run(store, fake_world.recipe(config), 16).execute(InProcess())


@pytest.mark.parametrize(("make", "message"), [(empty, "no finished chunk"), (without_images, "has no images")])
def test_nothing_to_load_is_an_error(make: Callable[[Path], None], message: str, tmp_path: Path) -> None:
    make(tmp_path / "data")
    with pytest.raises(DataError, match=message):
        GraspDataset(tmp_path / "data").scenes()


def test_a_damaged_shard_is_found_when_unpacking(tmp_path: Path) -> None:
    store = open_store(tmp_path / "data", fake_world.manifest(), False)
    Run(store, fake_world.recipe(CONFIG), 160).execute(InProcess())
    path = store.path("attempts", 0)
    path.write_bytes(path.read_bytes()[:-50])
    with pytest.raises(DataError, match="damaged"):
        GraspDataset(tmp_path / "data").attempts()
    assert not list((tmp_path / "data" / "cache").glob("attempts*"))


def test_a_shard_that_is_whole_but_not_the_one_that_was_written_is_found(tmp_path: Path) -> None:
    for name, seed in (("data", 1), ("other", 2)):
        store = open_store(tmp_path / name, fake_world.manifest(seed=seed), False)
        Run(store, fake_world.recipe(CONFIG, seed=seed), 160).execute(InProcess())
    other = Store(tmp_path / "other").path("scenes", 0)
    other.replace(Store(tmp_path / "data").path("scenes", 0))
    with pytest.raises(DataError, match="it is not the file that was written; run `generate --resume --repair`"):
        GraspDataset(tmp_path / "data").scenes()


def test_a_journal_that_lost_lines_is_found(tmp_path: Path) -> None:
    store = open_store(tmp_path / "data", fake_world.manifest(), False)
    Run(store, fake_world.recipe(CONFIG), 320).execute(InProcess())
    journal = tmp_path / "data" / "journal.jsonl"
    journal.write_bytes(journal.read_bytes().splitlines(keepends=True)[0])
    with pytest.raises(DataError, match="has lost chunks: its journal names 160 attempts, its manifest 320"):
        GraspDataset(tmp_path / "data")


def test_bad_requests_are_refused(dataset: GraspDataset) -> None:
    with pytest.raises(InvalidConfigurationError, match="batch_size"):
        dataset.scenes("train", batch_size=0)
