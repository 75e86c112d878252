"""Files that a user names: bounded when they are read, whole or unchanged when they are written.

**Reading.** Only a regular file is read, since a pipe, a device or a directory may wait or go on for ever; and only up
to a limit, since nobody's mistake should cost more memory than a file of its kind can need. JSON is refused where it
is nested deeper than any file of ours, or where one name stands twice in an object: which of the two was meant?

**Writing.** The new content goes into a file beside the old one, is flushed to the disk, and takes the old one's name
in one step. So at any moment, also after a kill, a full disk or a power cut, the name stands for the whole old content
or the whole new one. A journal grows at its end instead; a line that could not be written whole is cut off again. What
is no regular file, such as /dev/stdout, is written to and never replaced.
"""

from __future__ import annotations

import errno
import io
import json
import os
import secrets
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from bayesgrasp.errors import FileError, clipped, shown

KIB, MIB = 2**10, 2**20
DEEPEST = 32
"""Levels of JSON."""
PART = ".part"
"""Ends the name of a file that is being written; one that a killed process left may be removed."""
KINDS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def read_bytes(path: Path | str, limit: int) -> bytes:
    """The content of a regular file.

    Args:
        path: Which file.
        limit: Bytes that it may have.

    Raises:
        FileError: Missing, not a regular file, unreadable, or larger than that.
    """
    with _errors("read", path):
        _check_kind(path, os.stat(path))  # before it is opened, which alone may set a device off
        with _opened(path) as handle:
            return _read(path, handle, limit)


def read_text(path: Path | str, limit: int) -> str:
    """The content of a text file, UTF-8; raises `FileError` as `read_bytes` does, and for other encodings."""
    try:
        return read_bytes(path, limit).decode()
    except UnicodeDecodeError as error:
        raise FileError(f"{path} is not a text file (UTF-8): {clipped(error)}") from error


def read_json(path: Path | str, limit: int) -> Any:
    """The content of a JSON file; raises `FileError` as `read_text` does, and where `parsed_json` refuses it."""
    try:
        return parsed_json(read_text(path, limit))
    except ValueError as error:
        raise FileError(f"{path} is not JSON: {error}") from error


def parsed_json(text: str) -> Any:
    """The value that a piece of JSON stands for.

    Raises:
        ValueError: Not JSON, nested too deeply, or a name stands twice in an object; the message is one short line.
    """
    try:
        content = json.loads(text, object_pairs_hook=_unique)
    except RecursionError:
        raise ValueError(f"it is nested deeper than {DEEPEST} levels") from None
    except ValueError as error:
        raise ValueError(clipped(error)) from None
    level = [content]
    for _ in range(DEEPEST):
        level = [inner for outer in level for inner in _inside(outer)]
    if level:
        raise ValueError(f"it is nested deeper than {DEEPEST} levels")
    return content


def write_bytes(path: Path | str, content: bytes) -> None:
    """Give a file a new content, wholly or not at all.

    Raises:
        FileError: The directory does not exist, or the disk is full or refuses; an old content is still there.
    """
    with _errors("write", path):
        old = _status(path)
        if old is not None and stat.S_ISDIR(old.st_mode):
            raise FileError(f"cannot write {path}: it is a directory")
        if old is not None and not stat.S_ISREG(old.st_mode):
            with open(path, "wb", buffering=0) as device:
                _write_all(device.fileno(), content)
            return
        target = Path(os.path.realpath(path))  # a link goes on pointing where it points
        _check_directory(path, target.parent)
        _replace(target, content, None if old is None else stat.S_IMODE(old.st_mode))


def write_through(path: Path | str, write: Callable[[BinaryIO], object]) -> None:
    """Give a file what a function writes into an open one, such as a picture; as `write_bytes`."""
    content = io.BytesIO()
    write(content)
    write_bytes(path, content.getvalue())


def write_text(path: Path | str, text: str) -> None:
    """Give a text file a new content, UTF-8; as `write_bytes`."""
    write_bytes(path, text.encode())


def write_json(path: Path | str, content: Any, indent: int = 1) -> None:
    """Give a JSON file a new content; as `write_bytes`."""
    write_text(path, json.dumps(content, indent=indent) + "\n")


def append(path: Path | str, content: bytes) -> None:
    """Add to the end of a file and flush it to the disk, wholly or not at all.

    Raises:
        FileError: The disk is full or refuses; the file is as it was.
    """
    with _errors("write", path), open(path, "ab", buffering=0) as file:
        start = file.tell()
        try:
            _write_all(file.fileno(), content)
            os.fsync(file.fileno())
        except BaseException:
            os.ftruncate(file.fileno(), start)
            raise
        if start == 0:
            flush_directory(Path(path).parent)


def make_directory(path: Path | str) -> None:
    """Make a directory and those above it, unless it is there.

    Raises:
        FileError: The disk refuses, or a file is in the way.
    """
    with _errors("make the directory", path):
        Path(path).mkdir(parents=True, exist_ok=True)


def check_target(path: Path | str) -> None:
    """Refuse a file that cannot be written before the work for it begins.

    Raises:
        FileError: Its directory does not exist or cannot be written to, or the path is a directory.
    """
    directory = Path(os.path.realpath(path)).parent
    if Path(path).is_dir():
        raise FileError(f"cannot write {path}: it is a directory")
    _check_directory(path, directory)
    if not os.access(path if Path(path).exists() else directory, os.W_OK):
        raise FileError(f"cannot write {path}: permission denied, or the disk is read-only")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"{shown(next(n for n in names if names.count(n) > 1))} stands twice in one object")
    return content


def _inside(value: Any) -> Iterator[Any]:
    if isinstance(value, dict):
        yield from value.values()
    elif isinstance(value, list):
        yield from value


@contextmanager
def _opened(path: Path | str) -> Iterator[int]:
    """A file to read; a pipe without a writer does not make this wait."""
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    try:
        yield handle
    finally:
        os.close(handle)


def _read(path: Path | str, handle: int, limit: int) -> bytes:
    status = os.fstat(handle)
    _check_kind(path, status)
    if status.st_size > limit:
        raise FileError(f"{path} has {_size(status.st_size)}; at most {_size(limit)} are read")
    parts, missing = [], status.st_size + 1
    while missing > 0 and (part := os.read(handle, missing)):
        parts.append(part)
        missing -= len(part)
    if missing == 0:
        raise FileError(f"{path} grows while it is read: wait until it is written")
    return b"".join(parts)


def _write_all(handle: int, content: bytes) -> None:
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(handle, rest) :]


def _replace(path: Path, content: bytes, mode: int | None) -> None:
    part = path.with_name(f".{path.name[:40]}.{secrets.token_hex(4)}{PART}")
    handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
    try:
        try:
            if mode is not None:
                os.fchmod(handle, mode)
            _write_all(handle, content)
            os.fsync(handle)
        finally:
            os.close(handle)
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    flush_directory(path.parent)


def flush_directory(directory: Path) -> None:
    """Make the names in a directory survive a power cut."""
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _status(path: Path | str) -> os.stat_result | None:
    try:
        return os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return None


@contextmanager
def _errors(verb: str, path: Path | str) -> Iterator[None]:
    """Say which file, whatever the system says."""
    try:
        yield
    except FileError:
        raise
    except OSError as error:
        if error.errno in NO_ROOM:
            raise FileError(f"cannot {verb} {path}: the disk is full; what was there before is untouched") from error
        raise FileError(f"cannot {verb} {path}: {(error.strerror or clipped(error)).lower()}") from error
    except ValueError as error:  # a NUL character in the path
        raise FileError(f"cannot {verb} {shown(str(path))}: {clipped(error)}") from error


def _check_kind(path: Path | str, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = KINDS.get(stat.S_IFMT(status.st_mode), "something else")
        raise FileError(f"cannot read {path}: it is {kind}, not a regular file")


def _check_directory(path: Path | str, directory: Path) -> None:
    if not directory.is_dir():
        raise FileError(f"cannot write {path}: there is no directory {directory}")


def _size(count: int) -> str:
    for unit, size in (("MiB", MIB), ("KiB", KIB)):
        if count >= size:
            return f"{count / size:.4g} {unit}"
    return f"{count} bytes"
