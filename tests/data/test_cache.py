"""The unpacked arrays: made once, made again where they are damaged, and never half."""

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bayesgrasp.data import cache
from bayesgrasp.data.cache import INDEX, Columns, unpacked
from bayesgrasp.data.manifest import Entry
from bayesgrasp.errors import DataError

ROWS = 300
ENTRIES = [Entry(chunk, ROWS, ROWS, {}, [f"{chunk:064x}", "0" * 64]) for chunk in (0, 1)]
Damage = Callable[[Path], object]


class Shards:
    """Stands for the shards; counts how often one is read."""

    def __init__(self) -> None:
        self.reads = 0

    def read(self, chunk: int) -> Columns:
        self.reads += 1
        rng = np.random.default_rng(chunk)
        return {"draw": np.arange(ROWS) + ROWS * chunk, "image": rng.integers(0, 9, (ROWS, 4, 3), dtype=np.uint16)}

    def unpack(self, directory: Path) -> Columns:
        return unpacked(directory, "scenes", ENTRIES, 2 * ROWS, self.read)


def assert_right(columns: Columns) -> None:
    np.testing.assert_array_equal(columns["draw"], np.arange(2 * ROWS))
    expected = np.concatenate([Shards().read(chunk)["image"] for chunk in (0, 1)])
    np.testing.assert_array_equal(columns["image"], expected)


def flip(path: Path, place: int = -1) -> None:
    content = bytearray(path.read_bytes())
    content[place] ^= 4
    path.write_bytes(content)


def folder(directory: Path) -> Path:
    (found,) = directory.iterdir()
    return found


def test_it_is_made_once_and_not_read_through_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shards = Shards()
    assert_right(shards.unpack(tmp_path))
    assert shards.reads == 2
    monkeypatch.setattr(cache, "_crc", lambda path: pytest.fail("read through"))
    # As if it had been made a while ago.
    os.utime(folder(tmp_path) / INDEX, ns=(2**62, 2**62))
    assert_right(shards.unpack(tmp_path))
    assert shards.reads == 2


def test_a_copy_with_new_times_is_read_through_and_used(tmp_path: Path) -> None:
    shards = Shards()
    shards.unpack(tmp_path)
    for path in folder(tmp_path).glob("*.npy"):
        os.utime(path)
    assert_right(shards.unpack(tmp_path))
    assert shards.reads == 2


@pytest.mark.parametrize(
    "damage",
    [
        lambda d: flip(d / "image.npy"),
        lambda d: flip(d / "image.npy", 20),
        lambda d: flip(d / "draw.npy", 500),
        lambda d: os.truncate(d / "image.npy", 500),
        lambda d: os.truncate(d / "image.npy", 0),
        lambda d: (d / "image.npy").write_bytes(b"x" * 10_000),
        lambda d: (d / "image.npy").unlink(),
        lambda d: flip(d / INDEX, 40),
        lambda d: (d / INDEX).write_text("[]"),
        lambda d: (d / INDEX).write_text("{}"),
        lambda d: (d / INDEX).unlink(),
        lambda d: shutil.rmtree(d),
        lambda d: [path.unlink() for path in d.iterdir()],
    ],
)
def test_a_damaged_one_is_made_again(damage: Damage, tmp_path: Path) -> None:
    shards = Shards()
    shards.unpack(tmp_path)
    damage(folder(tmp_path))
    assert_right(shards.unpack(tmp_path))
    assert shards.reads == 4
    assert_right(shards.unpack(tmp_path))
    assert shards.reads == 4
    assert sorted(path.name for path in folder(tmp_path).iterdir()) == ["draw.npy", "image.npy", INDEX]


def test_a_flipped_bit_under_the_old_time_is_found_while_the_clock_is_coarse(tmp_path: Path) -> None:
    shards = Shards()
    shards.unpack(tmp_path)
    path = folder(tmp_path) / "draw.npy"
    time = path.stat().st_mtime_ns
    flip(path, 300)
    os.utime(path, ns=(time, time))
    os.utime(path.with_name(INDEX), ns=(time, time))
    assert_right(shards.unpack(tmp_path))


@pytest.mark.parametrize("fail_at", [0, 1, 2, 3])
def test_a_full_disk_is_one_error_and_leaves_nothing(
    fail_at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, real = iter(range(1000)), os.fsync

    def full(handle: int) -> None:
        if next(calls) == fail_at:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(handle)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(DataError, match="the disk is full"):
        Shards().unpack(tmp_path)
    monkeypatch.undo()
    assert list(tmp_path.iterdir()) == []
    assert_right(Shards().unpack(tmp_path))


def test_shards_of_other_lengths_than_the_journal_says_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="hold 600 rows, their journal says 601"):
        unpacked(tmp_path, "scenes", ENTRIES, 601, Shards().read)
    assert list(tmp_path.iterdir()) == []


def test_a_quicker_process_is_not_in_the_way(tmp_path: Path) -> None:
    """Both unpack; the second finds the work of the first in its place."""
    slow, quick = Shards(), Shards()
    real = slow.read

    def read(chunk: int) -> Columns:
        if chunk == 1:
            quick.unpack(tmp_path)
        return real(chunk)

    assert_right(unpacked(tmp_path, "scenes", ENTRIES, 2 * ROWS, read))
    assert len(list(tmp_path.iterdir())) == 1
