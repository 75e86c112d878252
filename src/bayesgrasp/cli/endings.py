"""How the command line ends when somebody outside ends it: Ctrl-C, SIGTERM, or a reader who has seen enough.

An interruption is raised as an exception where the command is, so that it takes its files, locks and workers with it;
a second one ends the process at once. While a command is being imported, the first one does, too: there is nothing to
tidy up yet, and libraries that try one import after another (trimesh does) take the exception for a missing package
and go on.

Standard output that nobody reads any more (``bayesgrasp objects list | head -1``) or that does not fit the disk is
turned off, since the interpreter would otherwise complain about it once more at its own end.
"""

import io
import os
import select
import signal
import sys
import threading
from types import FrameType, TracebackType

EXIT_ERROR = 2
EXIT_NO_GRASP = 3
EXIT_INTERRUPTED, EXIT_TERMINATED = 128 + signal.SIGINT, 128 + signal.SIGTERM
EXIT_CLOSED = 128 + signal.SIGPIPE
WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}


class TerminatedError(BaseException):
    """SIGTERM came; like `KeyboardInterrupt`, nothing but the entry point handles it."""


class OrderlyEnd:
    """Around a command: turns signals into exceptions, from when it is told that the command is loaded."""

    def __init__(self) -> None:
        self.at_once = True
        # Only the main thread may ask for signals; elsewhere they stay whose they are.
        ours = threading.current_thread() is threading.main_thread()
        self.signals = tuple(WORDS) if ours else ()
        self.before: dict[int, object] = {}

    def __enter__(self) -> "OrderlyEnd":
        self.before = {number: signal.signal(number, self._end) for number in self.signals}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for number, handler in self.before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def loaded(self) -> None:
        """From now on, an interruption is an exception."""
        self.at_once = False

    def _end(self, number: int, frame: FrameType | None) -> None:
        if self.at_once:
            os.write(2, f"{WORDS[signal.Signals(number)]}\n".encode())
            os._exit(128 + number)
        self.at_once = True
        raise KeyboardInterrupt if number == signal.SIGINT else TerminatedError


def output_is_closed() -> bool:
    """Whether the reader of standard output has gone."""
    try:
        poll = select.poll()
        poll.register(sys.stdout.fileno(), select.POLLOUT)
        return any(event & select.POLLERR for _, event in poll.poll(0))
    except (OSError, ValueError, AttributeError):  # no file behind it, or none at all
        return False


def turn_output_off() -> None:
    """Send what is still to be written to standard output nowhere."""
    try:
        handle = sys.stdout.fileno()
    except (io.UnsupportedOperation, ValueError, AttributeError):
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, handle)
    os.close(nowhere)
