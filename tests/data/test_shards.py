"""Shards: what goes in comes out, and damage is noticed."""

from pathlib import Path

import fake_world
import numpy as np
import pyarrow.parquet as pq
import pytest

from bayesgrasp.data import images
from bayesgrasp.data.shards import Chunk, decode, encode, read_attempts
from bayesgrasp.errors import DataError
from bayesgrasp.generation.chunks import ChunkMaker
from bayesgrasp.generation.proposal import Proposal


@pytest.fixture(scope="module")
def chunk() -> Chunk:
    recipe = fake_world.recipe()
    maker = ChunkMaker(recipe.build(), recipe.config, recipe.seed, recipe.scene)
    return maker.make(7, recipe.config.attempts_per_chunk, Proposal.prior(fake_world.OBJECTS))


@pytest.fixture
def files(chunk: Chunk, tmp_path: Path) -> tuple[Path, Path]:
    shard = encode(chunk, 7)
    paths = tmp_path / "attempts.parquet", tmp_path / "scenes.parquet"
    paths[0].write_bytes(shard.attempts)
    paths[1].write_bytes(shard.scenes)
    return paths


def test_round_trip_is_exact(chunk: Chunk, files: tuple[Path, Path]) -> None:
    back = decode(*files, 7)
    for name in ("attempts", "scenes", "hands"):
        for column, values in getattr(chunk, name).columns().items():
            read = getattr(back, name).columns()[column]
            assert read.dtype == values.dtype
            np.testing.assert_array_equal(read, values)


def test_the_same_records_give_the_same_bytes(chunk: Chunk) -> None:
    assert encode(chunk, 7) == encode(chunk, 7)


def test_any_parquet_reader_opens_the_tables(files: tuple[Path, Path]) -> None:
    table = pq.read_table(files[0])
    assert table.num_rows == 128
    assert len(table.column("position")[0].as_py()) == 3


def test_a_chunk_without_scenes_round_trips(chunk: Chunk, tmp_path: Path) -> None:
    bare = Chunk(chunk.attempts, chunk.scenes[:0], chunk.hands[:0])
    shard = encode(bare, 0)
    (tmp_path / "a").write_bytes(shard.attempts)
    (tmp_path / "s").write_bytes(shard.scenes)
    assert len(decode(tmp_path / "a", tmp_path / "s", 0).scenes) == 0


def test_attempts_take_few_bytes(chunk: Chunk) -> None:
    assert len(encode(chunk, 7).attempts) < 110 * len(chunk.attempts)  # file overhead included: these are only 128 rows


@pytest.mark.parametrize("cut", [0, 10, 5000, -8, -1])
def test_a_truncated_file_is_refused(cut: int, files: tuple[Path, Path]) -> None:
    files[0].write_bytes(files[0].read_bytes()[:cut])
    with pytest.raises(DataError, match="damaged"):
        read_attempts(files[0], 7)


def test_an_altered_page_is_refused(files: tuple[Path, Path]) -> None:
    content = bytearray(files[0].read_bytes())
    content[1000] ^= 1
    files[0].write_bytes(content)
    with pytest.raises(DataError, match="damaged"):
        read_attempts(files[0], 7)


def test_another_chunk_in_its_place_is_refused(files: tuple[Path, Path]) -> None:
    with pytest.raises(DataError, match="holds chunk 7 where chunk 8 belongs"):
        read_attempts(files[0], 8)


def test_another_schema_is_refused(files: tuple[Path, Path]) -> None:
    pq.write_table(pq.read_table(files[0]).replace_schema_metadata({"bayesgrasp.schema": "99"}), files[0])
    with pytest.raises(DataError, match="schema version 99"):
        read_attempts(files[0], 7)
    pq.write_table(pq.read_table(files[0]).replace_schema_metadata({}), files[0])
    with pytest.raises(DataError, match="no schema of bayesgrasp"):
        read_attempts(files[0], 7)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none\.parquet is missing"):
        read_attempts(tmp_path / "none.parquet", 0)


def test_images_are_kept_to_a_twentieth_of_a_millimetre() -> None:
    depth = np.random.default_rng(0).uniform(0.45, 1.0, (160, 256)).astype(np.float32)
    depth[:20] = 0
    depth[30] = 1.0
    image = images.to_units(depth)
    back = images.unpack(images.pack(image))
    np.testing.assert_array_equal(back, image)
    assert np.abs(images.to_metres(back) - depth).max() < 5.1e-5
    assert (images.to_metres(back)[:20] == 0).all()


def test_extreme_pixels_survive_packing() -> None:
    image = np.zeros((160, 256), np.uint16)
    image[:, ::2] = 65535
    np.testing.assert_array_equal(images.unpack(images.pack(image)), image)


@pytest.mark.parametrize("content", [b"", b"not an image", images.pack(np.zeros((4, 4), np.uint16))])
def test_bytes_that_are_no_image_are_refused(content: bytes) -> None:
    with pytest.raises(DataError, match="stored image"):
        images.unpack(content)
