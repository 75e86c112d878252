"""How commands end when somebody outside ends them: quietly, with the usual code, and with nothing left behind."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ENDED = Path(__file__).parents[1] / "support" / "ended.py"
MAIN = "from bayesgrasp.cli.main import main; main()"
PATIENCE = 60.0


@contextmanager
def started(how: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A command in a session of its own, when it says that it is ready."""
    command = [sys.executable, str(ENDED), how, str(folder)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        try:
            yield process
        finally:
            if alive(process.pid):
                os.killpg(process.pid, signal.SIGKILL)


def alive(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def wait_until(true: object) -> None:
    end = time.monotonic() + PATIENCE
    while not true() and time.monotonic() < end:  # type: ignore[operator]
        time.sleep(0.01)
    assert true()  # type: ignore[operator]


CODES = {signal.SIGINT: (130, "interrupted\n"), signal.SIGTERM: (143, "terminated\n")}


@pytest.mark.parametrize("number", CODES)
@pytest.mark.parametrize(("how", "tidy"), [("sleep", True), ("pool", True), ("swallow", False)])
def test_a_signal_ends_it_quietly_and_leaves_no_process(
    how: str, tidy: bool, number: signal.Signals, tmp_path: Path
) -> None:
    with started(how, tmp_path) as process:
        if how == "pool":
            wait_until((tmp_path / "endless").exists)
        os.killpg(process.pid, number)  # as a terminal does
        out, err = process.communicate(timeout=PATIENCE)
        assert (process.returncode, err) == CODES[number]
        assert "swallowed" not in out
        assert (tmp_path / "tidy").exists() == tidy
        wait_until(lambda: not alive(process.pid))


def test_workers_that_are_still_importing_say_nothing_either(tmp_path: Path) -> None:
    with started("pool", tmp_path) as process:
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
        assert (process.returncode, err) == CODES[signal.SIGINT]
        wait_until(lambda: not alive(process.pid))


def test_a_second_signal_ends_it_at_once(tmp_path: Path) -> None:
    with started("stubborn", tmp_path) as process:
        process.send_signal(signal.SIGINT)
        assert process.stdout is not None
        assert process.stdout.readline() == "still\n"
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=PATIENCE) == 130


def test_a_reader_who_has_gone_ends_it_quietly() -> None:
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-c", MAIN, "--help"]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


def test_output_that_does_not_fit_the_disk_is_one_line() -> None:
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-c", MAIN, "--help"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "error: standard output cannot be written: No space left on device\n"


def test_signals_are_given_back() -> None:
    code = (
        "import signal; signal.signal(2, signal.default_int_handler); "
        "from bayesgrasp.cli.main import main; main(['--version']); print(signal.getsignal(2))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "default_int_handler" in done.stdout
