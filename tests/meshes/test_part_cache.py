"""The cache of convex parts: by content, whole files only, built once by however many processes."""

import multiprocessing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import QhullError

from bayesgrasp.errors import AssetError, FileError
from bayesgrasp.meshes import part_cache
from bayesgrasp.meshes.decompose import DEFAULT, PAPER, Decomposition
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.meshes.part_cache import cache_file, cut_and_settle, peek
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
    built = cut_and_settle(mesh, "bottle")
    monkeypatch.setattr(part_cache, "decompose", None)
    assert same(cut_and_settle(mesh, "bottle"), built)
    found = peek(mesh)
    assert found is not None
    assert same(found, built)
    assert {path.suffix for path in tmp_path.rglob("*") if path.is_file()} <= {".npz", ".lock"}


def test_the_key_is_the_content_and_the_configuration() -> None:
    mesh = box(0.05, 0.05, 0.05).mesh
    moved = Mesh(mesh.vertices + 1e-6, mesh.faces)
    others = {cache_file(moved), cache_file(mesh, PAPER), cache_file(mesh, replace(DEFAULT, max_parts=7))}
    assert len({cache_file(mesh), *others}) == 4
    assert cache_file(Mesh(mesh.vertices.copy(), mesh.faces.copy())) == cache_file(mesh)


@pytest.mark.parametrize("content", [b"", b"nonsense", None])
def test_a_damaged_file_is_built_again(content: bytes | None) -> None:
    mesh = box(0.05, 0.05, 0.05).mesh
    built = cut_and_settle(mesh, "box")
    whole = cache_file(mesh).read_bytes()
    cache_file(mesh).write_bytes(whole[: len(whole) // 2] if content is None else content)
    assert peek(mesh) is None
    assert same(cut_and_settle(mesh, "box"), built)
    assert peek(mesh) is not None


def test_a_failed_build_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("out of luck")

    mesh = box(0.05, 0.05, 0.05).mesh
    monkeypatch.setattr(part_cache, "decompose", fail)
    with pytest.raises(RuntimeError, match="luck"):
        cut_and_settle(mesh, "box")
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
    cut_and_settle(turned([(0.04, 0.0), (0.04, 0.05), (0.01, 0.06), (0.01, 0.1)]).mesh, "bottle")


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


def test_a_remark_is_kept_and_said_each_time(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    solid = box(0.05, 0.05, 0.05)
    monkeypatch.setattr(part_cache, "decompose", lambda *_: Decomposition(solid.parts, "CoACD crashed, so what"))
    built = cut_and_settle(solid.mesh, "drill.stl")
    said = [record.getMessage() for record in caplog.records][-1]
    assert said == f"drill.stl: CoACD crashed, so what (remove {cache_file(solid.mesh)} to try again)"
    caplog.clear()
    monkeypatch.setattr(part_cache, "decompose", None)
    assert same(cut_and_settle(solid.mesh, "drill.stl"), built)
    assert [record.getMessage() for record in caplog.records] == [said]


@pytest.mark.parametrize("error", [AssetError("nothing comes of it"), QhullError("nothing\ncomes\nof it")])
def test_a_mesh_that_nothing_can_be_made_of_is_an_error_each_time(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fail(*_: object) -> None:
        raise error

    mesh = box(0.05, 0.05, 0.05).mesh
    monkeypatch.setattr(part_cache, "decompose", fail)
    for _ in range(2):
        with pytest.raises(AssetError, match=r"^drill\.stl: .*nothing comes of it"):
            cut_and_settle(mesh, "drill.stl")
        monkeypatch.setattr(part_cache, "decompose", None)
    assert peek(mesh) is None


def test_a_file_of_an_earlier_version_is_read(caplog: pytest.LogCaptureFixture) -> None:
    mesh = box(0.05, 0.05, 0.05).mesh
    built = cut_and_settle(mesh, "box")
    with np.load(cache_file(mesh)) as data:
        earlier = {name: data[name] for name in data.files if name != "remark"}
    np.savez(cache_file(mesh), **earlier)
    caplog.clear()
    assert same(cut_and_settle(mesh, "box"), built)
    assert caplog.records == []


def test_a_cache_that_cannot_be_written_to_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("BAYESGRASP_CACHE_DIR", str(tmp_path / "file"))
    with pytest.raises(FileError, match="file/objects"):
        cut_and_settle(box(0.05, 0.05, 0.05).mesh, "box")
