"""Run the cutting of a mesh in a process of its own, with limits of time and memory.

The libraries that cut are native code. On some meshes they crash, on others, also small ones, they do not end; neither
must happen to whoever asked. A process for each mesh costs a tenth of a second, and cutting costs seconds. It is the
program `cutting_child`, run by its file: so it neither imports the caller's script again, as multiprocessing would, nor
does it need to find the package.
"""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64, Int32

from bayesgrasp.errors import InvalidConfigurationError, clipped
from bayesgrasp.files import MIB

PROGRAM = Path(__file__).with_name("cutting_child.py")
PATIENCE = 10  # times as many seconds by the clock as of processor time: the machine may have other things to do
ENVIRONMENT = {
    # Half of CoACD's work is serial, so more threads gain nothing; each one takes address space, and time if it spins.
    "OMP_THREAD_LIMIT": "4",
    "OMP_WAIT_POLICY": "passive",
    "OPENBLAS_NUM_THREADS": "1",
}


class CuttingFailedError(Exception):
    """Why an algorithm gave no parts, as the end of a sentence that begins with its name."""


@dataclass(frozen=True)
class CutLimits:
    """What cutting one mesh by one algorithm may cost.

    Attributes:
        seconds: Of processor time. The scans of the catalogue need up to 35.
        memory_mib: Of address space. The scans of the catalogue need up to 700.

    Raises:
        InvalidConfigurationError: Not positive.
    """

    seconds: int = 120
    memory_mib: int = 4096

    def __post_init__(self) -> None:
        if self.seconds < 1 or self.memory_mib < 1:
            raise InvalidConfigurationError(f"limits of cutting must be at least 1 s and 1 MiB, got {self}")


LIMITS = CutLimits()


def cut_apart(
    vertices: Float64[np.ndarray, "v 3"],
    faces: Int32[np.ndarray, "f 3"],
    options: dict[str, Any],
    limits: CutLimits = LIMITS,
) -> list[Float64[np.ndarray, "_ 3"]]:
    """The pieces that a library cuts a mesh into, as points.

    Args:
        vertices: Metres.
        faces: Wound outwards.
        options: The fields of a `decompose.ConvexConfig`.
        limits: Of time and memory.

    Raises:
        CuttingFailedError: It crashed, or needed more than the limits, or gave no answer.
    """
    mesh = io.BytesIO()
    np.savez(mesh, vertices=vertices, faces=faces)
    options = options | {"seconds": limits.seconds, "memory": limits.memory_mib * MIB}
    # -P: the folder of the program, whose files are named as ours are, is no place to import from.
    command = [sys.executable, "-P", str(PROGRAM), json.dumps(options)]
    try:
        done = subprocess.run(
            command,
            input=mesh.getvalue(),
            capture_output=True,
            timeout=PATIENCE * limits.seconds,
            env=os.environ | ENVIRONMENT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise CuttingFailedError(f"did not end within {PATIENCE * limits.seconds} s") from None
    if done.returncode:
        raise CuttingFailedError(_reason(done.returncode, done.stderr, limits))
    return _read(done.stdout)


def _reason(code: int, said: bytes, limits: CutLimits) -> str:
    """Why a process ended, from its exit code and what it said."""
    if code == -signal.SIGXCPU:
        return f"needed more than {limits.seconds} s"
    if code < 0:
        return f"crashed ({signal.Signals(-code).name})"
    last = said.decode(errors="replace").strip().splitlines()[-1:] or [f"exit code {code}"]
    if "MemoryError" in last[0]:
        return f"needed more than {limits.memory_mib} MiB"
    return f"failed ({clipped(last[0], 80)})"


def _read(answer: bytes) -> list[Float64[np.ndarray, "_ 3"]]:
    try:
        with np.load(io.BytesIO(answer)) as data:
            vertices = np.asarray(data["vertices"], np.float64).reshape(-1, 3)
            pieces = np.split(vertices, np.cumsum(data["counts"])[:-1])
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile):
        raise CuttingFailedError("gave no answer that can be read") from None
    if not np.isfinite(vertices).all():
        raise CuttingFailedError("gave points that are not finite")
    return pieces
