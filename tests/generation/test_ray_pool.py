"""A Ray cluster of two nodes on this machine, one of which is killed in the middle of a run.

Each node is a session of processes of its own, so that all of it is found and ended, and nothing else.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import fake_world
import pytest

from bayesgrasp.data.store import Store
from bayesgrasp.generation.pool import InProcess
from bayesgrasp.generation.run import Run, open_store

ray = pytest.importorskip("ray", reason="the extra bayesgrasp[ray] is not installed")

from bayesgrasp.errors import InvalidConfigurationError  # noqa: E402
from bayesgrasp.generation.ray_pool import RayPool  # noqa: E402

ATTEMPTS = 900
RAY = Path(sys.executable).with_name("ray")
OPTIONS = (
    "--num-cpus=1",
    "--object-store-memory=100000000",
    "--disable-usage-stats",
    "--node-ip-address=127.0.0.1",
    "--min-worker-port=0",  # free ones: two nodes of one machine would ask for the same
    "--max-worker-port=0",
)
STARTING, RUNNING = 120, 300
"""Seconds for a node to start and for the run: finite, and enough where others take most of the processor."""


def environment() -> dict[str, str]:
    here = os.pathsep.join([str(Path(__file__).parents[1] / "support"), os.environ.get("PYTHONPATH", "")])
    ours = {"PYTHONPATH": here, "OMP_NUM_THREADS": "1", "RAY_USAGE_STATS_ENABLED": "0"}
    return os.environ | ours | {"RAY_health_check_period_ms": "1000"}  # a dead node is noticed after five of them


class Node:
    """``ray start``, and the session that its servers and their workers stay in."""

    def __init__(self, *options: str) -> None:
        self.starter = subprocess.Popen(
            [RAY, "start", *OPTIONS, *options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment(),
            start_new_session=True,
        )

    def started(self) -> str:
        """What the starter printed, once the node is up."""
        output, _ = self.starter.communicate(timeout=STARTING)
        assert self.starter.returncode == 0, output
        return str(output)

    def processes(self) -> dict[int, str]:
        """Process ids and names."""
        found = {}
        for path in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                if os.getsid(int(path.name)) == self.starter.pid:
                    found[int(path.name)] = (path / "comm").read_text().strip()
        return found

    def kill(self) -> None:
        """End all of them, those that were just being started too."""
        while alive := [pid for pid in self.processes() if not ended(pid)]:
            for pid in alive:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(0.05)
        self.starter.communicate()


def ended(pid: int) -> bool:
    """Whether a process is gone, or dead and only not collected yet by its parent."""
    try:
        return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


@pytest.fixture
def cluster() -> Iterator[tuple[str, int]]:
    """Address of the cluster, and the process id of its second node's server."""
    folder = Path("/tmp") / f"bg-{os.getpid()}"  # Ray's sockets need a short path
    nodes = [Node("--head", "--port=0", "--include-dashboard=false", f"--temp-dir={folder}")]
    try:
        output = nodes[0].started()
        address = re.search(r"--address='([0-9.:]+)'", output)
        assert address is not None, output
        nodes.append(Node(f"--address={address[1]}"))
        nodes[1].started()
        (server,) = (pid for pid, name in nodes[1].processes().items() if name == "raylet")
        yield address[1], server
    finally:
        for node in nodes:
            node.kill()
        shutil.rmtree(folder, ignore_errors=True)


def test_a_node_is_killed_and_nothing_is_lost(cluster: tuple[str, int], tmp_path: Path) -> None:
    address, second = cluster
    reference = open_store(tmp_path / "here", fake_world.manifest(), False)
    expected = Run(reference, fake_world.recipe(), ATTEMPTS).execute(InProcess())
    command = [
        sys.executable,
        Path(__file__).parents[1] / "support" / "clustered.py",
        tmp_path / "there",
        str(ATTEMPTS),
    ]
    subprocess.run([*command, address, str(second)], check=True, env=environment(), timeout=RUNNING)
    store = Store(tmp_path / "there")
    assert ended(second)
    assert store.manifest() == expected
    assert store.entries() == reference.entries()
    for chunk in store.entries():
        assert store.path("scenes", chunk).read_bytes() == reference.path("scenes", chunk).read_bytes()


def test_a_negative_number_of_chunks_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError):
        RayPool(None, -1)
