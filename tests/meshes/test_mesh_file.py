"""Mesh files: every format is read, and what cannot be used is refused in one short line that says why."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from solids import cube, is_solid, write

from bayesgrasp.errors import AssetError
from bayesgrasp.meshes import mesh_file
from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.meshes.mesh_file import FORMATS, read_mesh
from bayesgrasp.objects.shapes import box
from bayesgrasp.seeding import generator


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj", ".off"])
def test_every_format_gives_the_same_solid(tmp_path: Path, suffix: str) -> None:
    mesh = read_mesh(write(cube(), tmp_path / f"cube{suffix}"))
    assert is_solid(mesh)
    assert mesh.volume == pytest.approx(0.06 * 0.08 * 0.1, rel=1e-5)
    np.testing.assert_allclose(mesh.extents, [0.06, 0.08, 0.1], atol=1e-7)


def test_an_obj_with_a_missing_material_is_read(tmp_path: Path) -> None:
    write(cube(), tmp_path / "cube.obj")
    text = (tmp_path / "cube.obj").read_text()
    (tmp_path / "cube.obj").write_text("mtllib gone.mtl\nusemtl gone\n" + text)
    assert is_solid(read_mesh(tmp_path / "cube.obj"))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda m: Mesh(m.vertices * 1000, m.faces), "millimetres"),
        (lambda m: Mesh(m.vertices * 1e-3, m.faces), "extents"),
        (lambda m: Mesh(m.vertices * (1, 1, 0), m.faces), "flat"),
        (lambda m: Mesh(np.where(m.vertices > 0.049, np.nan, m.vertices), m.faces), "not finite"),
    ],
)
def test_a_useless_mesh_is_refused_with_the_reason(tmp_path: Path, change, reason: str) -> None:
    path = tmp_path / "bad.stl"
    made = change(cube())
    trimesh.Trimesh(made.vertices, made.faces, process=False, validate=False).export(path)
    with pytest.raises(AssetError, match=reason) as refused:
        read_mesh(path)
    assert "bad.stl" in str(refused.value)


def test_a_point_cloud_has_no_faces(tmp_path: Path) -> None:
    path = tmp_path / "cloud.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 0\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
    )
    with pytest.raises(AssetError, match=r"no faces|no triangle mesh"):
        read_mesh(path)


@pytest.mark.parametrize(
    "content",
    [b"", b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nend_header\n\x01", b"\x00" * 50, b"what?"],
)
def test_a_damaged_file_is_one_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "damaged.ply"
    path.write_bytes(content)
    with pytest.raises(AssetError, match=r"damaged\.ply"):
        read_mesh(path)


def test_missing_files_and_unknown_formats(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="no mesh file"):
        read_mesh(tmp_path / "gone.ply")
    (tmp_path / "model.fbx").write_text("")
    with pytest.raises(AssetError, match=r"valid are \.ply"):
        read_mesh(tmp_path / "model.fbx")


def refused(path: Path) -> str:
    """The message, which is one short line that names the file."""
    with pytest.raises(AssetError) as error:
        read_mesh(path)
    message = str(error.value)
    assert len(message) <= 300
    assert message.isprintable()
    assert path.name[-40:] in message
    return message


def read_or_message(path: Path) -> tuple[Mesh | None, str]:
    try:
        return read_mesh(path), ""
    except AssetError as error:
        return None, str(error)


def test_what_is_no_regular_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.ply")
    (tmp_path / "folder.ply").mkdir()
    (tmp_path / "endless.ply").symlink_to("/dev/zero")
    assert "a pipe" in refused(tmp_path / "pipe.ply")
    assert "a directory" in refused(tmp_path / "folder.ply")
    assert "a device" in refused(tmp_path / "endless.ply")


def test_a_file_larger_than_any_mesh_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "sparse.stl"
    with path.open("wb") as file:
        file.truncate(2**40)
    assert "128 MiB" in refused(path)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("vertices.ply", b"ply\nformat ascii 1.0\nelement vertex 99999999999999999999999\nend_header\n"),
        ("faces.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nelement face 1000001\nend_header\n0 0 0\n"),
        ("vertices.off", b"OFF\n# a comment\n# another\n1000001 1 0\n0 0 0\n"),
        ("faces.off", b"COFF 3 1000001 0\n0 0 0\n"),
    ],
)
def test_a_header_that_promises_too_much_is_not_believed(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    assert "at most 1,000,000 are read" in refused(tmp_path / name)


def test_a_header_of_comments_alone_is_read_once(tmp_path: Path) -> None:
    (tmp_path / "comments.off").write_bytes(b"OFF " + b"# " * 2000)
    refused(tmp_path / "comments.off")


@pytest.mark.parametrize("suffix", FORMATS)
def test_more_faces_than_any_use_has_are_refused(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(cube(), tmp_path / f"fine{suffix}")
    monkeypatch.setattr(mesh_file, "MOST_ELEMENTS", 3000)
    assert "at most 3,000" in refused(path)


def test_messages_stay_short_whatever_the_file_is_called_or_holds(tmp_path: Path) -> None:
    folder = tmp_path / ("long" * 50) / ("longer" * 40)
    folder.mkdir(parents=True)
    assert "no mesh file" in refused(folder / "gone.ply")
    assert "valid are" in refused(write(cube(), folder / "model.ply").rename(folder / f"model.{'x' * 200}"))
    (folder / "nonsense.obj").write_text("v 1 2 3\nf " + "\n\x1b[31m" * 5000 + "9" * 5000)
    refused(folder / "nonsense.obj")


def test_what_no_face_uses_does_not_matter(tmp_path: Path) -> None:
    solid = box(0.05, 0.06, 0.07).mesh
    with_strays = Mesh(np.concatenate([solid.vertices, [[np.nan] * 3, [1e300] * 3]]), solid.faces)
    lines = [f"v {x} {y} {z}" for x, y, z in with_strays.vertices] + [f"f {a} {b} {c}" for a, b, c in solid.faces + 1]
    (tmp_path / "strays.obj").write_text("\n".join(lines))
    np.testing.assert_allclose(read_mesh(tmp_path / "strays.obj").extents, [0.05, 0.06, 0.07])


def test_vertices_out_of_this_world_are_refused(tmp_path: Path) -> None:
    (tmp_path / "far.obj").write_text("v 1e308 0 0\nv -1e308 1 0\nv 0 1 1\nf 1 2 3")
    assert "extents inf" in refused(tmp_path / "far.obj")


@pytest.mark.parametrize("suffix", FORMATS)
def test_damage_anywhere_is_one_short_error_or_none(tmp_path: Path, suffix: str) -> None:
    """Flipped, missing, repeated and foreign bytes; a file that is still a mesh may be read."""
    rng = generator(FORMATS.index(suffix))
    whole = write(box(0.05, 0.06, 0.07).mesh, tmp_path / f"box{suffix}").read_bytes()
    path = tmp_path / f"damaged{suffix}"
    for _ in range(60):
        content = bytearray(whole)
        start, stop = sorted(rng.integers(len(content), size=2))
        match rng.integers(4):
            case 0:
                content[start] ^= 1 << rng.integers(8)
            case 1:
                del content[start:stop]
            case 2:
                content[start:start] = content[start:stop]
            case _:
                content[start:stop] = rng.bytes(int(rng.integers(1, 30)))
        path.write_bytes(content)
        mesh, message = read_or_message(path)
        assert len(message) <= 300
        assert message.isprintable()
        assert mesh is None or np.isfinite(mesh.vertices).all()
