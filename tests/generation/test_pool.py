"""The process pool: deaths of workers and of their owner."""

import ast
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import fake_tasks
import pytest
import torch

import bayesgrasp
from bayesgrasp.errors import DataError, InvalidConfigurationError
from bayesgrasp.generation.pool import InProcess, LocalPool

OWNER = """
import sys
from pathlib import Path
import fake_tasks
from bayesgrasp.generation.pool import LocalPool
if __name__ == "__main__":
    with LocalPool(1).start(fake_tasks.Squares(Path(sys.argv[1]), endless=3).start) as run:
        for square in run(range(10)):
            pass
"""


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def wait_for(condition: object, seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not condition():  # type: ignore[operator]
        if time.monotonic() > end:
            pytest.fail("what the test waits for did not happen")
        time.sleep(0.05)


def test_a_killed_worker_loses_nothing(tmp_path: Path) -> None:
    with LocalPool(2).start(fake_tasks.Squares(tmp_path, deadly=5).start) as run:
        assert sorted(run(range(20))) == [n**2 for n in range(20)]
        assert (tmp_path / "killed").exists()
        assert len(fake_tasks.workers(tmp_path)) >= 2
        with pytest.raises(DataError, match="-1 is negative"):
            list(run([3, -1, 4]))
        assert sorted(run(range(3))) == [0, 1, 4]  # the pool goes on after an error
    wait_for(lambda: not any(map(alive, fake_tasks.workers(tmp_path))))


def test_a_worker_that_dies_while_it_hands_over_its_result_loses_nothing(tmp_path: Path) -> None:
    with LocalPool(1).start(fake_tasks.Squares(tmp_path, torn=5).start) as run:
        assert sorted(run(range(8))) == [n**2 for n in range(8)]
    assert (tmp_path / "killed").exists()


def test_a_task_that_always_kills_is_given_up(tmp_path: Path) -> None:
    pool = LocalPool(1, attempts=2)
    with (
        pool.start(fake_tasks.Squares(tmp_path, 5, True).start) as run,
        pytest.raises(DataError, match="lost its worker"),
    ):
        list(run(range(10)))


def test_workers_end_with_their_owner_in_the_middle_of_a_task(tmp_path: Path) -> None:
    script = tmp_path / "owner.py"
    script.write_text(OWNER)
    path = os.pathsep.join([str(Path(__file__).parents[1] / "support"), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"PYTHONPATH": path}
    owner = subprocess.Popen([sys.executable, script, tmp_path], env=environment)
    wait_for(lambda: (tmp_path / "endless").exists())
    (worker,) = fake_tasks.workers(tmp_path)
    assert alive(worker)
    owner.send_signal(signal.SIGKILL)
    owner.wait()
    wait_for(lambda: not alive(worker))


def test_work_can_stay_in_the_process(tmp_path: Path) -> None:
    with InProcess().start(fake_tasks.Squares(tmp_path).start) as run:
        assert list(run([1, 2, 3])) == [1, 4, 9]
    assert fake_tasks.workers(tmp_path) == [os.getpid()]


def test_torch_has_one_thread_while_work_stays_in_the_process(tmp_path: Path) -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        with InProcess().start(lambda: lambda task: torch.get_num_threads()) as run:
            assert list(run([1, 2])) == [1, 1]
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


def test_one_place_keeps_process_wide_state() -> None:
    """Nothing else in the package begins empty at the top of a module, to be filled later, or is declared global."""
    kept = []
    for path in sorted(Path(bayesgrasp.__file__).parent.rglob("*.py")):
        tree = ast.parse(path.read_text())
        values = [node.value for node in tree.body if isinstance(node, ast.Assign | ast.AnnAssign)]
        kept += [path.name for value in values if value is not None and ast.unparse(value) in ("{}", "[]", "set()")]
        kept += [path.name for node in ast.walk(tree) if isinstance(node, ast.Global)]
    assert kept == ["pool.py"]


def test_no_workers_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="workers must be at least 1"):
        LocalPool(0)
