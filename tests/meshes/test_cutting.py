"""Cutting in a process of its own: whatever that process does, the caller gets pieces or a reason, and in time."""

import signal
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.meshes import cutting
from bayesgrasp.meshes.cutting import CutLimits, CuttingFailedError, cut_apart
from bayesgrasp.meshes.decompose import DEFAULT, PAPER
from bayesgrasp.objects.shapes import box

BOX = box(0.05, 0.06, 0.07).mesh
TIGHT = CutLimits(seconds=1, memory_mib=1024)
START = f"""import json, os, signal, sys, time
sys.path.insert(0, {str(cutting.PROGRAM.parent)!r})
import cutting_child
options = json.loads(sys.argv[1])
cutting_child.limit(options["seconds"], options["memory"])
"""


@pytest.fixture
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Puts a program in the place of the one that cuts."""

    def put(body: str) -> None:
        (tmp_path / "stand_in.py").write_text(START + body)
        monkeypatch.setattr(cutting, "PROGRAM", tmp_path / "stand_in.py")

    return put


@pytest.mark.parametrize("config", [DEFAULT, PAPER], ids=["coacd", "vhacd"])
def test_a_convex_mesh_is_one_piece(config) -> None:
    (piece,) = cut_apart(BOX.vertices, BOX.faces, asdict(config))
    np.testing.assert_allclose(np.ptp(piece, axis=0), [0.05, 0.06, 0.07], atol=1e-3)


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", r"crashed \(SIGSEGV\)"),
        ("os.abort()", r"crashed \(SIGABRT\)"),
        ("while True: pass", "needed more than 1 s"),
        ("bytearray(2**31)", "needed more than 1024 MiB"),
        ("raise ValueError('what is this?\\n' + 'x' * 9999)", r"failed \(x{77}\.\.\.\)"),
        ("sys.exit(7)", r"failed \(exit code 7\)"),
        ("print('half an ans', end='')", "gave no answer"),
        ("", "gave no answer"),
        (
            "import numpy\nnumpy.savez(sys.stdout.buffer, vertices=numpy.full((4, 3), numpy.nan), counts=[4])",
            "not finite",
        ),
    ],
)
def test_a_process_that_fails_is_a_reason(stand_in, body: str, reason: str) -> None:
    stand_in(body)
    with pytest.raises(CuttingFailedError, match=reason):
        cut_apart(BOX.vertices, BOX.faces, asdict(DEFAULT), TIGHT)


def test_a_process_that_sleeps_is_not_waited_for(stand_in, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in("time.sleep(600)")
    monkeypatch.setattr(cutting, "PATIENCE", 0.5)
    with pytest.raises(CuttingFailedError, match=r"did not end within 0\.5 s"):
        cut_apart(BOX.vertices, BOX.faces, asdict(DEFAULT), TIGHT)


def test_what_is_printed_does_not_get_between_the_pieces(stand_in) -> None:
    stand_in(
        "def talk(vertices, faces, options):\n"
        "    os.write(1, b'a library says hello')\n"
        "    return [vertices[:5], vertices[5:]]\n"
        "cutting_child.CUTTERS = {'coacd': talk}\n"
        "cutting_child.main(options)\n"
    )
    pieces = cut_apart(BOX.vertices, BOX.faces, asdict(DEFAULT), CutLimits(seconds=9))
    np.testing.assert_array_equal(np.concatenate(pieces), BOX.vertices)
    assert [len(piece) for piece in pieces] == [5, 3]


def test_two_boxes_on_which_coacd_does_not_end_take_no_longer_than_they_may() -> None:
    crossed = (box(0.1, 0.05, 0.05) + box(0.05, 0.1, 0.05).moved(x=0.01, y=0.01, z=0.01)).mesh
    with pytest.raises(CuttingFailedError, match="needed more than 1 s"):
        cut_apart(crossed.vertices, crossed.faces, asdict(DEFAULT), CutLimits(seconds=1))


def sleeps(process: int) -> bool:
    """Whether a process is there, and not as a mere entry that nobody has asked for yet."""
    try:
        return "\nState:\tZ" not in Path(f"/proc/{process}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not end a process with its parent")
def test_no_process_stays_behind_when_the_caller_is_killed(tmp_path: Path) -> None:
    note = tmp_path / "pid"
    (tmp_path / "sleeper.py").write_text(
        f"{START}open({str(note)!r} + '.part', 'w').write(str(os.getpid()))\n"
        f"os.replace({str(note)!r} + '.part', {str(note)!r})\ntime.sleep(600)"
    )
    script = (
        "from pathlib import Path\nimport numpy as np\nfrom bayesgrasp.meshes import cutting\n"
        f"cutting.PROGRAM = Path({str(tmp_path / 'sleeper.py')!r})\n"
        "cutting.cut_apart(np.zeros((3, 3)), np.zeros((1, 3), np.int32), {})\n"
    )
    with subprocess.Popen([sys.executable, "-c", script]) as caller:
        while not note.exists():
            assert caller.poll() is None
            time.sleep(0.02)
        caller.send_signal(signal.SIGKILL)
    for _ in range(500):
        if not sleeps(int(note.read_text())):
            return
        time.sleep(0.02)
    pytest.fail("the process that cuts outlives the one that asked for it")


def test_limits_are_positive() -> None:
    for wrong in ({"seconds": 0}, {"memory_mib": -1}):
        with pytest.raises(InvalidConfigurationError, match="at least 1 s and 1 MiB"):
            CutLimits(**wrong)
