"""Generates on a Ray cluster and kills one of its nodes in the middle. Started by `test_ray_pool.py`.

A program of its own, since Ray sends functions by value, which those that the tests check shapes in do not survive.
Usage: ``clustered.py DIRECTORY ATTEMPTS ADDRESS NODE``, the last being the process id of the node to kill.
"""

import os
import signal
import sys
from pathlib import Path

import fake_world

from bayesgrasp.generation.ray_pool import RayPool
from bayesgrasp.generation.run import Progress, Run, open_store


def main() -> None:
    directory, attempts, address, node = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3], int(sys.argv[4])

    def kill_once(progress: Progress) -> None:
        if progress.made > attempts // 3 and Path(f"/proc/{node}").exists():
            os.kill(node, signal.SIGKILL)

    store = open_store(directory, fake_world.manifest(), False)
    Run(store, fake_world.recipe(), attempts, kill_once).execute(RayPool(address))


if __name__ == "__main__":
    main()
