"""Everything that the package writes: a full or read-only disk is one clear error, and nothing is left half."""

import ast
import errno
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from matplotlib.figure import Figure

import bayesgrasp
from bayesgrasp import files
from bayesgrasp.diagnostics.plots import save
from bayesgrasp.errors import BayesgraspError
from bayesgrasp.evaluation.journal import Journal
from bayesgrasp.evaluation.report import Section, write_report
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.observation.depth_files import write_depth_png
from bayesgrasp.ratio.card import write_card
from bayesgrasp.ratio.tensor_file import write_tensors
from bayesgrasp.workflows.stages import Stages

PACKAGE = Path(bayesgrasp.__file__).parent
WRITERS: dict[str, Callable[[Path], object]] = {
    "camera.json": lambda folder: canonical_camera().save(folder / "camera.json"),
    "depth.png": lambda folder: write_depth_png(folder / "depth.png", np.full((20, 20), 0.7, np.float32)),
    "figure.png": lambda folder: save(Figure(), folder / "figure.png"),
    "report.html": lambda folder: write_report(folder / "report.html", "title", [Section("heading")]),
    "card.json": lambda folder: write_card(folder, {"schema": 1}),
    "w.safetensors": lambda folder: write_tensors(folder / "w.safetensors", {"a": torch.zeros(3)}, {}),
    "scenes.jsonl": lambda folder: Journal(folder, {"seed": 1}, resume=False),
    "experiment.json": lambda folder: Stages(folder, {"seed": 1}),
}


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS])
def test_a_disk_that_refuses_is_one_error_and_leaves_nothing(
    name: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    with monkeypatch.context() as patched:
        patched.setattr(files.os, "fsync", refuse)
        with pytest.raises(BayesgraspError, match="the disk is full" if code == errno.ENOSPC else "read-only") as error:
            WRITERS[name](tmp_path)
    assert name in str(error.value)
    assert [path for path in tmp_path.iterdir() if path.stat().st_size] == []
    WRITERS[name](tmp_path)
    assert (tmp_path / name).stat().st_size > 0


@pytest.mark.parametrize("name", WRITERS)
def test_a_place_that_is_taken_is_one_error(name: str, tmp_path: Path) -> None:
    (tmp_path / name).mkdir()
    with pytest.raises(BayesgraspError, match=re.escape(str(tmp_path))):
        WRITERS[name](tmp_path)


STREAMED = {
    "files.py": "the one place",
    "objects/fetch.py": "downloads grow and are resumed",
    "meshes/part_cache.py": "a cache that may fail",
    "lift/bullet/item.py": "a file for the engine, in a temporary directory",
    "data/cache.py": "arrays that need not fit the memory, in a directory renamed as a whole",
}


def writes(source: str) -> list[str]:
    """Calls that give a file a content without the one place for it."""
    calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    return [ast.unparse(call) for call in calls if _is_write(call)]


def _is_write(call: ast.Call) -> bool:
    if not isinstance(call.func, ast.Attribute | ast.Name):
        return False
    name = call.func.attr if isinstance(call.func, ast.Attribute) else call.func.id
    first = ast.unparse(call.args[0]) if call.args else ""
    if name in ("write_text", "write_bytes"):
        return isinstance(call.func, ast.Attribute)
    if name in ("save", "savefig") and ast.unparse(call.func) != "camera.save":
        return "path" in first.lower() or "/" in first
    modes = [c.value for c in ast.walk(call) if isinstance(c, ast.Constant) and isinstance(c.value, str)]
    return name == "open" and any(set(mode) & set("wax") and set(mode) <= set("rwaxbt+") for mode in modes)


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_files_are_written_in_one_place(path: Path) -> None:
    if str(path.relative_to(PACKAGE)) not in STREAMED:
        assert writes(path.read_text()) == []


@pytest.mark.parametrize(
    "source",
    [
        "path.write_text('a')",
        "Path(name).write_bytes(b'')",
        "figure.savefig(path, dpi=3)",
        "image.save(out / 'a.png')",
        "open(path, 'w')",
        "path.open('ab')",
    ],
)
def test_a_planted_write_is_caught(source: str) -> None:
    assert len(writes(source)) == 1
    assert writes("write_text(path, 'a')\nimage.save(file, format='PNG')\npath.open('rb')\nmodel.load(path)") == []
