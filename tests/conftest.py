"""What holds for every test: shapes and types are checked, and global state is left as it was found.

The import hook must be in place before the first import of bayesgrasp, so nothing above it may import the package.
"""

import hashlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import jaxtyping
import numpy as np
import pytest

if any(name.split(".")[0] == "bayesgrasp" for name in sys.modules):
    raise RuntimeError("bayesgrasp was imported before its shape checks were installed")
jaxtyping.install_import_hook("bayesgrasp", "beartype.beartype")

import torch  # noqa: E402

SET_BY_OTHERS = frozenset({"PYTEST_CURRENT_TEST", "TORCHINDUCTOR_CACHE_DIR"})
"""Variables that pytest, and torch when its first optimiser is built, set by themselves."""
SHARED = Path(__file__).parents[2] / "shared"


def _digest(*parts: bytes) -> str:
    return hashlib.sha256(b" ".join(parts)).hexdigest()[:16]


def _numpy_stream() -> str:
    _, keys, position, _, _ = np.random.get_state(legacy=True)  # noqa: NPY002
    return _digest(np.asarray(keys).tobytes(), str(position).encode())


def _globals() -> dict[str, object]:
    """Every process-wide setting and stream that a library must leave alone.

    Not Python's own random stream: beartype draws from it to choose which item of a sequence to check.
    """
    return {
        "torch threads": torch.get_num_threads(),
        "torch default dtype": torch.get_default_dtype(),
        "torch default device": torch.get_default_device(),
        "torch grad mode": torch.is_grad_enabled(),
        "torch anomaly mode": torch.is_anomaly_enabled(),
        "torch deterministic": torch.are_deterministic_algorithms_enabled(),
        "torch matmul precision": torch.get_float32_matmul_precision(),
        "torch random stream": _digest(torch.get_rng_state().numpy().tobytes()),
        "numpy error handling": np.geterr(),
        "numpy print options": np.get_printoptions(),
        "numpy random stream": _numpy_stream(),
        "working directory": os.getcwd(),
        "environment": {k: v for k, v in os.environ.items() if k not in SET_BY_OTHERS},
    }


@pytest.fixture(autouse=True)
def _globals_unchanged() -> Iterator[None]:
    before = _globals()
    yield
    after = _globals()
    changed = {name: (before[name], after[name]) for name in before if before[name] != after[name]}
    assert not changed, f"the test left global state changed (before, after): {changed}"


def _shared(path: Path) -> Path:
    if not path.is_dir():
        pytest.skip(f"the shared data {path.relative_to(SHARED.parent)} is not beside the repository")
    return path


@pytest.fixture(scope="session")
def training_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small data set of the fake world to read from, made once for all tests that train on it."""
    from training_set import make_training_set  # imports the simulators, which most tests do without

    return make_training_set(tmp_path_factory.mktemp("training_set") / "data", 3000)


@pytest.fixture(scope="session")
def ycb_dir() -> Path:
    """Directory of YCB scans in the official layout; skips where it is absent."""
    return _shared(SHARED / "objects" / "ycb")


@pytest.fixture(scope="session")
def real_depth_dir() -> Path:
    """Directory of real depth images with their camera file; skips where it is absent."""
    return _shared(SHARED / "real_depth")
