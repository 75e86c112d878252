"""Mesh files: what can be repaired is repaired, what cannot is refused with the reason."""

import logging
from pathlib import Path

import numpy as np
import pytest
import trimesh

from bayesgrasp.errors import AssetError
from bayesgrasp.meshes.mesh import SHELL_THICKNESS, Mesh, boundary_loops, close, read_mesh, split_fans
from bayesgrasp.objects.shapes import box, hollow


def write(mesh: Mesh, path: Path) -> Path:
    mesh.to_trimesh().export(path)
    return path


def cube() -> Mesh:
    made = trimesh.creation.box(extents=(0.06, 0.08, 0.1)).subdivide().subdivide().subdivide().subdivide()
    return Mesh(np.array(made.vertices, np.float64), np.array(made.faces, np.int32))


def is_solid(mesh: Mesh) -> bool:
    made = mesh.to_trimesh()
    return bool(made.is_watertight and made.is_winding_consistent and mesh.volume > 0)


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


def test_inward_winding_is_turned() -> None:
    mesh = cube()
    assert is_solid(close(Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())))


def test_mixed_winding_is_made_consistent() -> None:
    mesh = cube()
    faces = mesh.faces.copy()
    faces[::3] = faces[::3, ::-1]
    assert is_solid(close(Mesh(mesh.vertices, faces)))


def test_a_body_wound_inwards_beside_another_is_turned_but_a_cavity_stays() -> None:
    outer, inner, beside = cube(), box(0.02, 0.02, 0.02).mesh, box(0.02, 0.02, 0.02).moved(x=0.1).mesh
    for other, volume in ((inner, -8e-6), (beside, 8e-6)):
        faces = np.concatenate([outer.faces, other.faces[:, ::-1] + len(outer.vertices)]).astype(np.int32)
        both = close(Mesh(np.concatenate([outer.vertices, other.vertices]), faces))
        assert both.volume == pytest.approx(outer.volume + volume, rel=1e-6)


def test_boxes_that_share_an_edge_are_taken_apart() -> None:
    one, two = box(0.04, 0.04, 0.04).mesh, box(0.04, 0.04, 0.04).moved(x=0.04, y=0.04).mesh
    faces = np.concatenate([one.faces, two.faces + len(one.vertices)]).astype(np.int32)
    vertices, index = np.unique(np.concatenate([one.vertices, two.vertices]).round(9), axis=0, return_inverse=True)
    joined = Mesh(vertices, index.reshape(-1)[faces].astype(np.int32))
    assert not joined.to_trimesh().is_watertight
    apart = split_fans(joined)
    assert len(apart.vertices) == 16
    assert is_solid(apart)


def test_a_manifold_mesh_keeps_its_vertices() -> None:
    assert len(split_fans(cube()).vertices) == len(cube().vertices)


def test_a_small_hole_is_filled() -> None:
    mesh = cube()
    holed = Mesh(mesh.vertices, mesh.faces[1:])
    assert len(boundary_loops(holed.faces)) == 1
    assert not is_solid(holed)
    filled = close(holed)
    assert is_solid(filled)
    assert filled.volume == pytest.approx(mesh.volume, rel=1e-3)


def test_a_missing_bottom_is_filled() -> None:
    mesh = cube()
    bottomless = Mesh(mesh.vertices, mesh.faces[mesh.vertices[mesh.faces][:, :, 2].max(axis=1) > -0.0499])
    filled = close(bottomless)
    assert is_solid(filled)
    assert filled.volume == pytest.approx(mesh.volume, rel=1e-6)


def test_an_open_top_becomes_a_shell(caplog: pytest.LogCaptureFixture) -> None:
    mesh = cube()
    topless = Mesh(mesh.vertices, mesh.faces[mesh.vertices[mesh.faces][:, :, 2].min(axis=1) < 0.0499])
    with caplog.at_level(logging.WARNING):
        shell = close(topless)
    assert "shell" in caplog.text
    assert is_solid(shell)
    area = 0.06 * 0.08 + 2 * 0.1 * (0.06 + 0.08)
    assert shell.volume == pytest.approx(area * SHELL_THICKNESS, rel=0.15)


def test_flaps_and_double_faces_are_dropped() -> None:
    mesh = cube()
    vertices = np.concatenate([mesh.vertices, [[0.2, 0, 0], [0.201, 0, 0], [0.2, 0.001, 0]]])
    n = len(mesh.vertices)
    faces = np.concatenate([mesh.faces, mesh.faces[:5], [[n, n + 1, n + 2], [0, 0, 1]]]).astype(np.int32)
    cleaned = close(Mesh(vertices, faces))
    assert is_solid(cleaned)
    np.testing.assert_allclose(cleaned.extents, mesh.extents, atol=1e-9)


def test_a_closed_vessel_keeps_its_cavity() -> None:
    cup = hollow([(0.03, 0.0), (0.04, 0.08)], wall=0.003, floor=0.004).mesh
    assert close(cup).volume == pytest.approx(cup.volume, rel=1e-6)


def bad(vertices: object, faces: object) -> Mesh:
    return Mesh(np.array(vertices, np.float64).reshape(-1, 3), np.array(faces, np.int32).reshape(-1, 3))


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
