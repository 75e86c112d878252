"""What a data set says about itself: read back as written, and no flipped bit passes."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import fake_world
import pytest

from bayesgrasp.data.manifest import Entry, fingerprint
from bayesgrasp.data.store import Store
from bayesgrasp.errors import DataError
from bayesgrasp.seeding import generator

MANIFEST = replace(fake_world.manifest(), totals={"attempts": 7}, commit="abc")
ENTRY = Entry(3, 7, 2, {"0": [0, 1, 2, 1, 3, 0]}, ["ab" * 32, "cd" * 32])


@pytest.fixture
def store(tmp_path: Path) -> Store:
    made = Store.create(tmp_path, MANIFEST)
    made.journal_path.write_text(ENTRY.to_line() + replace(ENTRY, chunk=4).to_line())
    return made


def test_both_are_read_back(store: Store) -> None:
    assert store.manifest() == MANIFEST
    assert store.entries() == {3: ENTRY, 4: replace(ENTRY, chunk=4)}


def flipped(content: bytes, number: int) -> bytes:
    """One of its bits, the other way round; the last line break stays, since without it a line is none."""
    place, bit = divmod(int(generator(number).integers(8 * (len(content) - 1))), 8)
    return content[:place] + bytes([content[place] ^ (1 << bit)]) + content[place + 1 :]


@pytest.mark.parametrize("name", ["manifest.json", "journal.jsonl"])
def test_no_flipped_bit_passes(name: str, store: Store) -> None:
    path = store.directory / name
    whole, read = path.read_bytes(), store.manifest if name == "manifest.json" else store.entries
    expected = read()
    messages = []
    for number in range(400):
        path.write_bytes(flipped(whole, number))
        try:
            assert read() == expected  # a space that became another blank
        except DataError as error:
            messages.append(str(error))
    assert len(messages) > 350
    assert all(len(message) < 400 and message.isprintable() for message in messages)


def test_those_of_earlier_versions_are_read(store: Store) -> None:
    for path in (store.manifest_path, store.journal_path):
        lines = path.read_text().splitlines() if path.suffix == ".jsonl" else [path.read_text()]
        contents = [json.loads(line) for line in lines]
        path.write_text("".join(json.dumps({k: v for k, v in c.items() if k != "checksum"}) + "\n" for c in contents))
    assert store.manifest() == MANIFEST
    assert store.entries()[3] == ENTRY


@pytest.mark.parametrize(
    "change",
    [
        lambda m: m.update(seed="1"),
        lambda m: m.update(seed=1.0),
        lambda m: m.update(seed=True),
        lambda m: m.update(seed=-1),
        lambda m: m.update(attempts=0),
        lambda m: m.update(objects=[1]),
        lambda m: m.update(objects=[{"id": 3}]),
        lambda m: m.update(config=[]),
        lambda m: m.update(gripper=None),
        lambda m: m.update(more=1),
        lambda m: m.pop("gripper"),
    ],
)
def test_a_manifest_of_other_types_is_refused(change: Callable[[dict[str, object]], object], store: Store) -> None:
    content = json.loads(store.manifest_path.read_text())
    del content["checksum"]
    change(content)
    store.manifest_path.write_text(json.dumps(content))
    with pytest.raises(DataError, match=r"manifest\.json is damaged"):
        store.manifest()


@pytest.mark.parametrize(
    "line",
    [
        b"[]",
        b"3",
        b"\xff",
        b"",
        b"{}",
        replace(ENTRY, attempts=-1).to_line().encode(),
        replace(ENTRY, sha256=["ab"]).to_line().encode(),
        replace(ENTRY, outcomes={"x": [0, 1, 2, 1, 3, 0]}).to_line().encode(),
        replace(ENTRY, outcomes={"0": [1]}).to_line().encode(),
        replace(ENTRY, outcomes={"0": [0, 1, 2, 1, 3, -1]}).to_line().encode(),
    ],
)
def test_a_line_that_is_no_entry_is_refused(line: bytes, store: Store) -> None:
    store.journal_path.write_bytes(line.rstrip() + b"\n")
    with pytest.raises(DataError, match=r"journal\.jsonl is damaged"):
        store.entries()


def test_a_directory_in_the_place_of_a_file_is_an_error(store: Store) -> None:
    for path, read in ((store.manifest_path, store.manifest), (store.journal_path, store.entries)):
        path.unlink()
        path.mkdir()
        with pytest.raises(DataError, match="a directory, not a regular file"):
            read()


def test_the_fingerprint_is_that_of_the_very_data() -> None:
    entries = {3: ENTRY, 4: replace(ENTRY, chunk=4)}
    name = fingerprint(MANIFEST, entries)
    assert fingerprint(replace(MANIFEST, totals={}, version="9"), dict(reversed(entries.items()))) == name
    others = (
        fingerprint(MANIFEST, {3: ENTRY}),
        fingerprint(MANIFEST, {**entries, 4: replace(ENTRY, chunk=4, sha256=["ab" * 32, "ce" * 32])}),
        fingerprint(replace(MANIFEST, seed=2), entries),
    )
    assert len({name, *others}) == 4


def test_a_set_is_of_a_hand_and_an_earlier_one_of_the_first(store: Store) -> None:
    other = replace(MANIFEST, gripper_sha256=64 * "0")
    assert "'none' of description" in other.hand.compare(MANIFEST.hand)
    assert other.identity != MANIFEST.identity
    content = MANIFEST.to_dict()
    del content["checksum"], content["gripper_sha256"]
    store.manifest_path.write_text(json.dumps(content))
    assert store.manifest() == MANIFEST
    assert "gripper_sha256" not in MANIFEST.identity  # such sets go on with --resume
