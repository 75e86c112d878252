"""The cache of convex parts: by content, whole files only, built once by however many processes."""

import multiprocessing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesgrasp.meshes import part_cache
from bayesgrasp.meshes.convex import DEFAULT, PAPER
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.meshes.part_cache import entry, peek, prepare
from bayesgrasp.meshes.resting import Resting
from bayesgrasp.objects.shapes import box, turned


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BAYESGRASP_CACHE_DIR", str(tmp_path))


def same(one: Resting, other: Resting) -> bool:
    return (
        len(one.parts) == len(other.parts)
        and all(np.array_equal(a.vertices, b.vertices) for a, b in zip(one.parts, other.parts, strict=True))
        and all(np.array_equal(a.faces, b.faces) for a, b in zip(one.parts, other.parts, strict=True))
        and np.array_equal(one.mesh_to_object, other.mesh_to_object)
        and one.floor == other.floor
    )


def test_the_second_time_comes_from_the_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    mesh = turned([(0.04, 0.0), (0.04, 0.04), (0.01, 0.05), (0.01, 0.1)]).mesh
    assert peek(mesh) is None
    built = prepare(mesh, "bottle")
    monkeypatch.setattr(part_cache, "decompose", None)
    assert same(prepare(mesh, "bottle"), built)
    found = peek(mesh)
    assert found is not None
    assert same(found, built)
    assert {path.suffix for path in tmp_path.rglob("*") if path.is_file()} <= {".npz", ".lock"}


def test_the_key_is_the_content_and_the_configuration() -> None:
    mesh = box(0.05, 0.05, 0.05).mesh
    moved = Mesh(mesh.vertices + 1e-6, mesh.faces)
    keys = {entry(mesh), entry(moved), entry(mesh, PAPER), entry(mesh, replace(DEFAULT, max_parts=7))}
    assert len(keys) == 4
    assert entry(Mesh(mesh.vertices.copy(), mesh.faces.copy())) == entry(mesh)


@pytest.mark.parametrize("content", [b"", b"nonsense", None])
def test_a_damaged_file_is_built_again(content: bytes | None) -> None:
    mesh = box(0.05, 0.05, 0.05).mesh
    built = prepare(mesh, "box")
    whole = entry(mesh).read_bytes()
    entry(mesh).write_bytes(whole[: len(whole) // 2] if content is None else content)
    assert peek(mesh) is None
    assert same(prepare(mesh, "box"), built)
    assert peek(mesh) is not None


def test_a_failed_build_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("out of luck")

    mesh = box(0.05, 0.05, 0.05).mesh
    monkeypatch.setattr(part_cache, "decompose", fail)
    with pytest.raises(RuntimeError, match="luck"):
        prepare(mesh, "box")
    assert peek(mesh) is None
    monkeypatch.undo()


def _build_and_count(log: Path, barrier) -> None:
    cut = part_cache.decompose

    def counting(*arguments: object) -> object:
        with log.open("a") as file:
            file.write("built\n")
        return cut(*arguments)  # type: ignore[arg-type]

    part_cache.decompose = counting  # type: ignore[assignment]
    barrier.wait()
    prepare(turned([(0.04, 0.0), (0.04, 0.05), (0.01, 0.06), (0.01, 0.1)]).mesh, "bottle")


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")  # from Python 3.12 on
def test_many_processes_build_one_object_once(tmp_path: Path) -> None:
    context = multiprocessing.get_context("fork")
    barrier = context.Barrier(4)
    workers = [context.Process(target=_build_and_count, args=(tmp_path / "log", barrier)) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert [worker.exitcode for worker in workers] == [0] * 4
    assert (tmp_path / "log").read_text() == "built\n"
