"""One writer for a directory: the second one is refused, and the lock ends with its process."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from bayesgrasp.errors import FileError
from bayesgrasp.locks import sole_writer

HOLDER = (
    "import sys, time\nfrom pathlib import Path\nfrom bayesgrasp.locks import sole_writer\n"
    "with sole_writer(Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(600)\n"
)


def test_a_second_writer_is_refused_and_a_later_one_is_not(tmp_path: Path) -> None:
    directory = tmp_path / "out" / "run"
    with sole_writer(directory):
        with pytest.raises(FileError, match=r"another process is writing to .*run: wait"), sole_writer(directory):
            pass
        with sole_writer(tmp_path / "out"):
            pass
    with sole_writer(directory):
        pass


def test_the_lock_of_a_killed_process_is_free(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(FileError, match="another process"), sole_writer(tmp_path):
            pass
        os.kill(holder.pid, signal.SIGKILL)
        holder.wait()
    with sole_writer(tmp_path):
        pass


def test_a_directory_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="cannot make the directory"), sole_writer(tmp_path / "file" / "out"):
        pass
    (tmp_path / "lock").mkdir()
    with pytest.raises(FileError, match="cannot write to"), sole_writer(tmp_path):
        pass
