"""What can be made a closed surface is made one."""

import logging

import numpy as np
import pytest
from solids import cube, is_solid

from bayesgrasp.meshes.mesh import Mesh
from bayesgrasp.meshes.repair import SHELL_THICKNESS, boundary_loops, close_surface, split_fans
from bayesgrasp.objects.shapes import box, hollow


def test_inward_winding_is_turned() -> None:
    mesh = cube()
    assert is_solid(close_surface(Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())))


def test_mixed_winding_is_made_consistent() -> None:
    mesh = cube()
    faces = mesh.faces.copy()
    faces[::3] = faces[::3, ::-1]
    assert is_solid(close_surface(Mesh(mesh.vertices, faces)))


def test_a_body_wound_inwards_beside_another_is_turned_but_a_cavity_stays() -> None:
    outer, inner, beside = cube(), box(0.02, 0.02, 0.02).mesh, box(0.02, 0.02, 0.02).moved(x=0.1).mesh
    for other, volume in ((inner, -8e-6), (beside, 8e-6)):
        faces = np.concatenate([outer.faces, other.faces[:, ::-1] + len(outer.vertices)]).astype(np.int32)
        both = close_surface(Mesh(np.concatenate([outer.vertices, other.vertices]), faces))
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
    filled = close_surface(holed)
    assert is_solid(filled)
    assert filled.volume == pytest.approx(mesh.volume, rel=1e-3)


def test_a_missing_bottom_is_filled() -> None:
    mesh = cube()
    bottomless = Mesh(mesh.vertices, mesh.faces[mesh.vertices[mesh.faces][:, :, 2].max(axis=1) > -0.0499])
    filled = close_surface(bottomless)
    assert is_solid(filled)
    assert filled.volume == pytest.approx(mesh.volume, rel=1e-6)


def test_an_open_top_becomes_a_shell(caplog: pytest.LogCaptureFixture) -> None:
    mesh = cube()
    topless = Mesh(mesh.vertices, mesh.faces[mesh.vertices[mesh.faces][:, :, 2].min(axis=1) < 0.0499])
    with caplog.at_level(logging.WARNING):
        shell = close_surface(topless)
    assert "shell" in caplog.text
    assert is_solid(shell)
    area = 0.06 * 0.08 + 2 * 0.1 * (0.06 + 0.08)
    assert shell.volume == pytest.approx(area * SHELL_THICKNESS, rel=0.15)


def test_flaps_and_double_faces_are_dropped() -> None:
    mesh = cube()
    vertices = np.concatenate([mesh.vertices, [[0.2, 0, 0], [0.201, 0, 0], [0.2, 0.001, 0]]])
    n = len(mesh.vertices)
    faces = np.concatenate([mesh.faces, mesh.faces[:5], [[n, n + 1, n + 2], [0, 0, 1]]]).astype(np.int32)
    cleaned = close_surface(Mesh(vertices, faces))
    assert is_solid(cleaned)
    np.testing.assert_allclose(cleaned.extents, mesh.extents, atol=1e-9)


def test_a_closed_vessel_keeps_its_cavity() -> None:
    cup = hollow([(0.03, 0.0), (0.04, 0.08)], wall=0.003, floor=0.004).mesh
    assert close_surface(cup).volume == pytest.approx(cup.volume, rel=1e-6)
