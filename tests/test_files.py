"""Files that a user names: nothing endless, huge or ambiguous is read, and nothing is ever half written."""

import errno
import os
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from bayesgrasp import files
from bayesgrasp.errors import BayesgraspError, FileError, clipped, shown

LIMIT = 1000
Write = Callable[[Path], None]


def test_a_file_is_read_up_to_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "full"
    path.write_bytes(b"x" * LIMIT)
    assert files.read_bytes(path, LIMIT) == b"x" * LIMIT
    path.write_bytes(b"")
    assert files.read_text(path, LIMIT) == ""
    path.write_bytes(b"x" * (LIMIT + 1))
    with pytest.raises(FileError, match=r"full has 1001 bytes; at most 1000 bytes are read"):
        files.read_bytes(path, LIMIT)


def test_a_size_is_worded_in_units(tmp_path: Path) -> None:
    path = tmp_path / "sparse"
    path.touch()
    os.truncate(path, 5 * files.MIB)
    with pytest.raises(FileError, match="has 5 MiB; at most 2 KiB"):
        files.read_bytes(path, 2 * files.KIB)


def test_what_is_no_regular_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, kind in (
        (tmp_path / "pipe", "a pipe"),
        (Path("/dev/zero"), "a device"),
        (tmp_path, "a directory"),
    ):
        with pytest.raises(FileError, match=f"it is {kind}, not a regular file"):
            files.read_bytes(path, LIMIT)


def test_a_file_that_grows_is_not_read_for_ever() -> None:
    """Files of the kernel say that they are empty."""
    with pytest.raises(FileError, match="grows while it is read"):
        files.read_bytes("/proc/self/status", LIMIT)


def test_missing_files_and_impossible_names_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"cannot read .*absent: no such file"):
        files.read_bytes(tmp_path / "absent", LIMIT)
    with pytest.raises(FileError, match=r"cannot read 'a.x00b'"):
        files.read_bytes("a\0b", LIMIT)
    with pytest.raises(FileError, match=r"cannot write 'a.x00b'"):
        files.write_bytes("a\0b", b"")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{", "not JSON"),
        (b"\xff\xfe", "not a text file"),
        (b"[" * 400 + b"]" * 400, "nested deeper than 32 levels"),
        (b"[" * 1_000_000, "nested deeper than 32 levels"),
        (b'{"a": 1, "b": {"c": 1, "c": 2}}', "'c' stands twice in one object"),
        (b"1" * 5000, "not JSON"),
    ],
)
def test_json_that_is_damaged_deep_or_ambiguous_is_refused(content: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "content.json"
    path.write_bytes(content)
    with pytest.raises(FileError, match=message) as refused:
        files.read_json(path, 2 * files.MIB)
    assert len(str(refused.value)) < 400
    assert "\n" not in str(refused.value)


def test_json_is_read_as_it_was_written(tmp_path: Path) -> None:
    content = {"a": [1, 2.5, None, True], "b": {"c": "\u00fc"}}
    files.write_json(tmp_path / "content.json", content)
    assert files.read_json(tmp_path / "content.json", LIMIT) == content


def put(path: Path) -> None:
    files.write_bytes(path, b"new")


def add(path: Path) -> None:
    files.append(path, b"new")


@pytest.mark.parametrize("write", [put, add])
@pytest.mark.parametrize("failing", ["write", "fsync", "replace"])
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO])
def test_a_disk_that_refuses_leaves_everything_as_it_was(
    write: Write, failing: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if write is add and failing == "replace":
        return
    path = tmp_path / "content"
    path.write_bytes(b"old")

    def refuse(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(files.os, failing, refuse)
    with pytest.raises(FileError, match="disk is full" if code in files.NO_ROOM else "cannot write") as refused:
        write(path)
    monkeypatch.undo()
    assert isinstance(refused.value, BayesgraspError)
    assert str(path) in str(refused.value)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("write", [put, add])
def test_a_write_that_stops_in_the_middle_leaves_nothing(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, real = tmp_path / "content", os.write
    path.write_bytes(b"old")
    monkeypatch.setattr(files.os, "write", lambda handle, content: real(handle, content[:1]))
    monkeypatch.setattr(files.os, "fsync", lambda handle: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        write(path)
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_new_content_takes_the_place_of_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "content"
    path.write_bytes(b"old and longer")
    path.chmod(0o640)
    (tmp_path / "link").symlink_to(path)
    files.write_bytes(tmp_path / "link", b"new")
    assert path.read_bytes() == b"new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert (tmp_path / "link").is_symlink()
    files.append(path, b"er")
    assert path.read_bytes() == b"newer"
    files.write_bytes(tmp_path / ("x" * 255), b"")
    (tmp_path / ("x" * 255)).unlink()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["content", "link"]


def test_a_device_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    files.write_bytes("/dev/null", b"gone")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    with pytest.raises(FileError, match="cannot write /dev/full: the disk is full"):
        files.write_bytes("/dev/full", b"gone")


def test_a_place_that_cannot_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path, message in (
        (tmp_path / "nowhere" / "plan.json", "there is no directory .*nowhere"),
        (tmp_path / "file" / "plan.json", "there is no directory .*file"),
        (tmp_path, "is a directory"),
    ):
        for attempt in (files.check_target, put):
            with pytest.raises(FileError, match=message):
                attempt(path)
    files.check_target(tmp_path / "plan.json")
    files.check_target("/dev/null")


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_directory_without_permission_is_refused_before_the_work(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(FileError, match="permission denied"):
        files.check_target(tmp_path / "plan.json")
    tmp_path.chmod(0o700)


def test_directories_are_made_or_the_obstacle_is_named(tmp_path: Path) -> None:
    files.make_directory(tmp_path / "a" / "b")
    files.make_directory(tmp_path / "a" / "b")
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="cannot make the directory"):
        files.make_directory(tmp_path / "file" / "b")


VALUES = ["x" * 10**6, [[[[[[1]]]]]], {"a": "b" * 1000}, 10**6000, "line\nbreak\x1b[2J", "\ud800", 1e300, None]


def test_what_a_message_quotes_is_one_short_printable_line() -> None:
    for value in VALUES:
        text = shown(value)
        assert 0 < len(text) <= 60
        assert text.isprintable()
        assert text.isascii()
    assert clipped("a\n b\tc" + "\x1b" + "d" * 1000, 20).startswith("a b c?d")
