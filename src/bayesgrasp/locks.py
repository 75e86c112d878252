"""One writer for a directory: a second process that would write into it is refused, not made to wait.

The lock is the operating system's (`flock` on the file `lock` inside the directory), so it dies with its process,
however that ends; the file stays and means nothing by itself.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from bayesgrasp.errors import FileError
from bayesgrasp.files import make_directory

NAME = "lock"


@contextmanager
def sole_writer(directory: Path) -> Iterator[None]:
    """Keep every other writer out of a directory, which is made if it is not there.

    Raises:
        FileError: Another process is writing to it, or the directory cannot be written to.
    """
    make_directory(directory)
    try:
        lock = FileLock(directory / NAME, blocking=False)
        lock.acquire()
    except Timeout as error:
        raise FileError(
            f"another process is writing to {directory}: wait until it is done, or give another directory"
        ) from error
    except OSError as error:
        raise FileError(f"cannot write to {directory}: {(error.strerror or str(error)).lower()}") from error
    try:
        yield
    finally:
        lock.release()
