"""A Ray cluster of two nodes on this machine, one of which is killed in the middle of a run."""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import fake_world
import pytest

from bayesgrasp.data.engine import Run, open_store
from bayesgrasp.data.pool import InProcess
from bayesgrasp.data.store import Store

ray = pytest.importorskip("ray", reason="the extra bayesgrasp[ray] is not installed")

from bayesgrasp.data.scale import RayPool  # noqa: E402
from bayesgrasp.errors import InvalidConfigurationError  # noqa: E402

ATTEMPTS = 900
RAY = Path(sys.executable).with_name("ray")


def environment() -> dict[str, str]:
    here = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    return os.environ | {"PYTHONPATH": here, "OMP_NUM_THREADS": "1", "RAY_USAGE_STATS_ENABLED": "0"}


def start(*options: str) -> str:
    command = [RAY, "start", "--num-cpus=1", "--object-store-memory=100000000", "--disable-usage-stats", *options]
    return subprocess.run(command, check=True, capture_output=True, text=True, env=environment()).stdout


def servers() -> dict[int, str]:
    """Process ids and names of Ray's servers on this machine: one gcs_server for a cluster, one raylet for a node."""
    found = {}
    for path in Path("/proc").glob("[0-9]*/comm"):
        with suppress(OSError):
            name = path.read_text().strip()
            if name in ("raylet", "gcs_server"):
                found[int(path.parent.name)] = name
    return found


@pytest.fixture
def cluster() -> Iterator[tuple[str, int]]:
    """Address of the cluster, and the process id of its second node."""
    others = set(servers())
    folder = Path("/tmp") / f"bg-{os.getpid()}"  # Ray's sockets need a short path
    try:
        output = start("--head", "--port=0", "--include-dashboard=false", f"--temp-dir={folder}")
        address = re.search(r"--address='([0-9.:]+)'", output)
        assert address is not None, output
        head = set(servers())
        start(f"--address={address[1]}")
        (second,) = set(servers()) - head
        yield address[1], second
    finally:
        for pid in set(servers()) - others:
            os.kill(pid, signal.SIGKILL)
        shutil.rmtree(folder, ignore_errors=True)


def test_a_node_is_killed_and_nothing_is_lost(cluster: tuple[str, int], tmp_path: Path) -> None:
    address, second = cluster
    reference = open_store(tmp_path / "here", fake_world.manifest(), False)
    expected = Run(reference, fake_world.recipe(), ATTEMPTS).execute(InProcess())
    command = [sys.executable, Path(__file__).with_name("clustered.py"), tmp_path / "there", str(ATTEMPTS)]
    subprocess.run([*command, address, str(second)], check=True, env=environment())
    store = Store(tmp_path / "there")
    assert second not in servers()
    assert store.manifest() == expected
    assert store.entries() == reference.entries()
    for chunk in store.entries():
        assert store.path("scenes", chunk).read_bytes() == reference.path("scenes", chunk).read_bytes()


def test_a_negative_number_of_chunks_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError):
        RayPool(None, -1)
