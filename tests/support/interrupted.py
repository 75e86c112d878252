"""Runs a generation again and again, killing it at random moments, until it has been killed often enough.

Started by `test_run.py` as a program of its own: it imports everything once and forks for each run, so that a run
costs milliseconds and a kill can fall anywhere in it. Usage: ``interrupted.py DIRECTORY KILLS SEED``.
"""

import os
import random
import signal
import sys
import time
from pathlib import Path

import fake_world

from bayesgrasp.generation.pool import InProcess
from bayesgrasp.generation.run import Run, open_store

ATTEMPTS = 3000


def run(directory: Path) -> None:
    store = open_store(directory, fake_world.manifest(), resume=True)
    Run(store, fake_world.recipe(), ATTEMPTS).execute(InProcess())


def killed_after(directory: Path, seconds: float) -> bool:
    """Start a run, kill it after so long; whether it was still running."""
    child = os.fork()
    if child == 0:
        run(directory)
        os._exit(0)
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if os.WIFEXITED(status) and os.WEXITSTATUS(status) != 0:
        raise SystemExit(f"a run failed with {status}")
    return os.WIFSIGNALED(status)


def main() -> None:
    directory, kills, rng = Path(sys.argv[1]), int(sys.argv[2]), random.Random(int(sys.argv[3]))
    journal = directory / "journal.jsonl"
    done = 0
    while done < kills:
        if killed_after(directory, rng.uniform(0.0, 0.15)):
            done += 1
        elif journal.exists():
            # Finished between kills: take half of the lines away, as if it had been stopped there.
            lines = journal.read_bytes().splitlines(keepends=True)
            journal.write_bytes(b"".join(lines[: len(lines) // 2]))
    run(directory)


if __name__ == "__main__":
    main()
