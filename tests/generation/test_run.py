"""Exactly once: interrupted, resumed, extended, damaged, out of disk, the records are those of an undisturbed run."""

import errno
import hashlib
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import fake_world
import interrupted
import numpy as np
import pytest

from bayesgrasp import files
from bayesgrasp.data.manifest import TABLES, Manifest
from bayesgrasp.data.store import Store
from bayesgrasp.errors import DataError, FileError, InvalidConfigurationError
from bayesgrasp.generation.pool import InProcess
from bayesgrasp.generation.run import Progress, Run, differences, open_store
from bayesgrasp.locks import sole_writer


def run(directory: Path, attempts: int, resume: bool = False, repair: bool = False) -> Manifest:
    store = open_store(directory, fake_world.manifest(), resume)
    return Run(store, fake_world.recipe(), attempts).execute(InProcess(), repair)


def fails_with_a_full_disk(directory: Path) -> bool:
    try:
        run(directory, 1000, resume=True)
    except DataError as error:
        if "disk is full" not in str(error):
            raise
        return True
    return False


def contents(directory: Path) -> dict[str, str]:
    """SHA-256 of every shard, and the journal's entries in order of their chunks."""
    files = [path for table in TABLES for path in sorted((directory / table).iterdir())]
    found = {str(path.relative_to(directory)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
    return found | {f"entry {e.chunk}": str(e) for e in Store(directory).entries().values()}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Manifest]:
    directory = tmp_path_factory.mktemp("undisturbed") / "data"
    return directory, run(directory, interrupted.ATTEMPTS)


def test_counts_add_up(undisturbed: tuple[Path, Manifest]) -> None:
    directory, manifest = undisturbed
    totals = manifest.totals
    assert totals["attempts"] == interrupted.ATTEMPTS == sum(totals["outcomes"].values())
    assert totals["scenes"] == -(-interrupted.ATTEMPTS // 32)
    assert sum(map(sum, totals["per_object"].values())) == interrupted.ATTEMPTS
    records = [Store(directory).attempts(chunk) for chunk in Store(directory).entries()]
    assert sum(map(len, records)) == interrupted.ATTEMPTS
    draws = np.concatenate([r.draw for r in records])
    assert (np.diff(draws) >= 0).all()


def test_killed_at_random_moments_it_ends_with_the_same_records(
    undisturbed: tuple[Path, Manifest], tmp_path: Path
) -> None:
    directory = tmp_path / "data"
    script = Path(__file__).parents[1] / "support" / "interrupted.py"
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    subprocess.run([sys.executable, script, directory, "24", "3"], check=True, env=environment)
    assert contents(directory) == contents(undisturbed[0])
    assert Store(directory).manifest() == undisturbed[1]


def test_stopped_at_every_write_it_ends_with_the_same_records(
    undisturbed: tuple[Path, Manifest], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every flush of the first chunks fails once with a full disk: one clear error, and the next run goes on."""
    real, failures = os.fsync, 0
    for fail_at in range(0, 36, 3):
        calls = iter(range(1000))

        def full(handle: int, fail_at: int = fail_at, calls: object = calls) -> None:
            if next(calls) == fail_at:  # type: ignore[call-overload]
                raise OSError(errno.ENOSPC, "No space left on device")
            real(handle)

        monkeypatch.setattr(files.os, "fsync", full)
        failures += fails_with_a_full_disk(tmp_path / "data")
    monkeypatch.undo()
    assert failures >= 6
    assert not list((tmp_path / "data").rglob("*.part"))
    run(tmp_path / "data", interrupted.ATTEMPTS, resume=True)
    assert contents(tmp_path / "data") == contents(undisturbed[0])


def test_more_attempts_can_be_added(undisturbed: tuple[Path, Manifest], tmp_path: Path) -> None:
    run(tmp_path / "data", 500)
    run(tmp_path / "data", 1300, resume=True)
    run(tmp_path / "data", interrupted.ATTEMPTS, resume=True)
    assert contents(tmp_path / "data") == contents(undisturbed[0])


def test_a_finished_run_makes_nothing_again(undisturbed: tuple[Path, Manifest]) -> None:
    seen: list[Progress] = []
    store = open_store(undisturbed[0], fake_world.manifest(), resume=True)
    Run(store, fake_world.recipe(), interrupted.ATTEMPTS, seen.append).execute(InProcess())
    assert [p.made for p in seen] == [0]
    assert seen[0].attempts == interrupted.ATTEMPTS


def test_the_seed_matters(undisturbed: tuple[Path, Manifest], tmp_path: Path) -> None:
    store = open_store(tmp_path / "data", fake_world.manifest(seed=2), resume=False)
    Run(store, fake_world.recipe(seed=2), 128).execute(InProcess())
    assert not np.array_equal(store.attempts(0).position, Store(undisturbed[0]).attempts(0).position)


@pytest.mark.parametrize("damage", ["truncate", "alter", "remove"])
@pytest.mark.parametrize("table", TABLES)
def test_a_damaged_shard_stops_the_run_and_is_repaired_on_request(damage: str, table: str, tmp_path: Path) -> None:
    run(tmp_path / "data", 500)
    before = contents(tmp_path / "data")
    path = Store(tmp_path / "data").path(table, 2)
    whole = path.read_bytes()
    if damage == "remove":
        path.unlink()
    else:
        path.write_bytes(whole[:-100] if damage == "truncate" else whole[:900] + b"?" + whole[901:])
    with pytest.raises(DataError, match="make chunk 2 again"):
        run(tmp_path / "data", 500, resume=True)
    run(tmp_path / "data", 500, resume=True, repair=True)
    assert contents(tmp_path / "data") == before


def test_another_configuration_is_refused(tmp_path: Path) -> None:
    run(tmp_path / "data", 100)
    before = contents(tmp_path / "data")
    other = replace(fake_world.manifest(), config={"generate": {"proposal": "prior"}})
    with pytest.raises(DataError, match=r"config\.generate is None there"):
        open_store(tmp_path / "data", other, resume=True)
    with pytest.raises(DataError, match="seed is 1 there and 5 now"):
        open_store(tmp_path / "data", fake_world.manifest(seed=5), resume=True)
    assert contents(tmp_path / "data") == before


def test_a_new_run_does_not_overwrite(tmp_path: Path) -> None:
    run(tmp_path / "data", 100)
    with pytest.raises(DataError, match="already holds a data set"):
        run(tmp_path / "data", 100)


def test_resume_starts_where_there_is_nothing(tmp_path: Path) -> None:
    assert run(tmp_path / "data", 100, resume=True).totals["attempts"] == 100


def test_two_writers_are_refused(tmp_path: Path) -> None:
    run(tmp_path / "data", 100)
    with sole_writer(tmp_path / "data"), pytest.raises(FileError, match="another process is writing"):
        run(tmp_path / "data", 200, resume=True)


def test_another_schema_and_broken_manifests_are_refused(tmp_path: Path) -> None:
    run(tmp_path / "data", 100)
    path = tmp_path / "data" / "manifest.json"
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"schema_version": 99}))
    with pytest.raises(DataError, match="schema version 99"):
        Store(tmp_path / "data").manifest()
    path.write_text("{")
    with pytest.raises(DataError, match="damaged"):
        Store(tmp_path / "data").manifest()
    with pytest.raises(DataError, match=r"no manifest\.json"):
        Store(tmp_path / "nowhere").manifest()


def test_a_broken_journal_is_refused_but_a_torn_end_is_not(tmp_path: Path) -> None:
    run(tmp_path / "data", 500)
    before = contents(tmp_path / "data")
    journal = tmp_path / "data" / "journal.jsonl"
    whole = journal.read_bytes()
    journal.write_bytes(whole[:-20])
    assert len(Store(tmp_path / "data").entries()) == 3
    run(tmp_path / "data", 500, resume=True)
    assert contents(tmp_path / "data") == before
    journal.write_bytes(b"?" + whole)
    with pytest.raises(DataError, match=r"journal\.jsonl is damaged"):
        Store(tmp_path / "data").entries()


def test_differences_name_the_place() -> None:
    assert differences({"a": [1, {"b": 2}]}, {"a": [1, {"b": 3}]}) == ["a[1].b is 2 there and 3 now"]
    assert differences({"a": 1}, {"a": 1}) == []


@pytest.mark.parametrize("bad", [{"attempts": 0}, {"seed": -1}])
def test_impossible_manifests_are_refused(bad: dict[str, int]) -> None:
    with pytest.raises(InvalidConfigurationError, match="must be at least"):
        fake_world.manifest(**bad)
