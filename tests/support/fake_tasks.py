"""Work for the pools, light to import."""

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
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
        torn: This number kills its worker in the middle of handing over its square, once.
    """

    flags: Path
    deadly: int = -1
    always: bool = False
    endless: int = -1
    torn: int = -1

    def start(self) -> Callable[[int], int]:
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
        if number == self.torn and not flag.exists():
            flag.touch()
            Connection._send = _send_half  # type: ignore[attr-defined]
        return number**2


def _send_half(connection: Connection, message: bytes) -> None:
    """Write the first half of a message and die."""
    os.write(connection.fileno(), message[: len(message) // 2])
    os.kill(os.getpid(), signal.SIGKILL)


def workers(flags: Path) -> list[int]:
    """Process ids of the workers that were built."""
    return [int(path.name.removeprefix("worker-")) for path in flags.glob("worker-*")]
