"""A command line whose one command does what its name says until somebody ends it. Started by `test_endings.py`.

Usage: ``ended.py HOW FOLDER``. It says ``ready`` when it may be ended, and leaves a file ``tidy`` in the folder where
it was given the time to tidy up.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

from fake_tasks import Squares

from bayesgrasp.cli.main import Command, main
from bayesgrasp.generation.pool import LocalPool


def say(word: str) -> None:
    """Tell the test."""
    sys.stdout.write(f"{word}\n")
    sys.stdout.flush()


def sleep(folder: Path) -> None:
    """Wait, and tidy up."""
    try:
        say("ready")
        time.sleep(600)
    finally:
        (folder / "tidy").touch()


def stubborn(folder: Path) -> None:
    """Wait, and wait again while tidying up."""
    try:
        sleep(folder)
    finally:
        say("still")
        time.sleep(600)


def pool(folder: Path) -> None:
    """Let two workers wait."""
    try:
        with LocalPool(2).start(Squares(folder, endless=1).start) as run:
            say("ready")
            list(run([1, 1, 1]))
    finally:
        (folder / "tidy").touch()


def swallow() -> Callable[[Path], None]:
    """Import libraries that take every exception for a missing package."""
    say("ready")
    try:
        time.sleep(600)
    except BaseException:
        say("swallowed")
    return sleep


def load(command: Command) -> Callable[..., None]:
    """Stands for the import of a command."""
    how = sys.argv[1]
    return swallow() if how == "swallow" else {"sleep": sleep, "stubborn": stubborn, "pool": pool}[how]


if __name__ == "__main__":
    Command.load = load  # type: ignore[method-assign,assignment]
    main(["plan", "--folder", sys.argv[2]])
