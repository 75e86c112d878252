"""Work for the pools, light to import."""

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bayesgrasp.errors import DataError


@dataclass(frozen=True)
class Squares:
    """Squares numbers; a negative one is an error, and one with a flag file kills its worker until the file exists.

    Attributes:
        flags: Directory of the flag files.
        deadly: This number kills its worker: once, or always.
        always: Whether it does so every time.
        endless: This number is never done; a flag file says that it was begun.
    """

    flags: Path
    deadly: int = -1
    always: bool = False
    endless: int = -1

    def __call__(self) -> Callable[[int], int]:
        (self.flags / f"worker-{os.getpid()}").touch()
        return self.square

    def square(self, number: int) -> int:
        if number < 0:
            raise DataError(f"{number} is negative")
        flag = self.flags / "killed"
        if number == self.deadly and (self.always or not flag.exists()):
            flag.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        while number == self.endless:
            (self.flags / "endless").touch()
            time.sleep(0.01)
        return number**2


def workers(flags: Path) -> list[int]:
    """Process ids of the workers that were built."""
    return [int(path.name.removeprefix("worker-")) for path in flags.glob("worker-*")]
