"""Convex parts: hulls of few corners that stay close, and how far they are from a mesh."""

import numpy as np
import pytest
import trimesh

from bayesgrasp.errors import AssetError
from bayesgrasp.meshes.convex import ConvexPart, hull_part
from bayesgrasp.meshes.deviation import deviation
from bayesgrasp.meshes.mesh import Mesh, signed_volume
from bayesgrasp.objects.shapes import box, hollow
from bayesgrasp.seeding import generator


def convex_and_outward(part: ConvexPart) -> bool:
    normals, offsets = part.halfspaces()
    return bool((part.vertices @ normals.T <= offsets + 1e-9).all()) and signed_volume(part.vertices[part.faces]) > 0


def test_the_hull_of_a_cube_with_points_inside_is_the_cube() -> None:
    points = np.concatenate(
        [generator(0).uniform(-0.04, 0.04, (200, 3)), box(0.1, 0.1, 0.1).mesh.vertices - (0, 0, 0.05)]
    )
    part = hull_part(points)
    assert len(part.vertices) == 8
    assert len(part.faces) == 12
    assert signed_volume(part.vertices[part.faces]) == pytest.approx(1e-3)
    assert convex_and_outward(part)


def test_depth_is_negative_inside_and_exact_in_front_of_a_face() -> None:
    part = box(0.1, 0.1, 0.1).parts[0]
    points = np.array([[0, 0, 0.05], [0.06, 0, 0.05], [0, 0, 0.13]])
    np.testing.assert_allclose(part.depth(points), [-0.05, 0.01, 0.03], atol=1e-12)


@pytest.mark.parametrize("corners", [16, 64])
def test_a_thinned_sphere_keeps_to_both_sides_of_the_sphere(corners: int) -> None:
    sphere = np.array(trimesh.creation.icosphere(subdivisions=4, radius=0.04).vertices)
    part = hull_part(sphere, corners)
    assert len(part.vertices) <= corners
    assert convex_and_outward(part)
    _, offsets = part.halfspaces()
    inward, outward = 0.04 - offsets.min(), np.linalg.norm(part.vertices, axis=1).max() - 0.04
    # Half of what is missing is made up for by growing, so neither side has the whole error.
    assert 0 < outward < inward < 4 * outward
    assert inward < {16: 0.012, 64: 0.003}[corners]


def test_refining_ends_at_the_tolerance() -> None:
    sphere = np.array(trimesh.creation.icosphere(subdivisions=4, radius=0.04).vertices)
    coarse, fine = (hull_part(sphere, 1000, tolerance) for tolerance in (0.004, 0.001))
    assert len(coarse.vertices) < len(fine.vertices) < 200
    assert float(fine.depth(sphere).max()) <= 0.001


def test_flat_points_are_no_part() -> None:
    with pytest.raises(AssetError, match="volume"):
        hull_part(np.c_[generator(0).uniform(size=(20, 2)), np.zeros(20)])


def test_deviation_measures_a_known_excess_and_gap() -> None:
    mesh = box(0.1, 0.1, 0.1).mesh
    taller = box(0.1, 0.1, 0.104).parts
    found = deviation(mesh, taller)
    assert found.excess_max == pytest.approx(0.004, abs=1e-5)
    assert found.gap_max == 0.0
    assert found.volume_ratio == pytest.approx(1.04)
    found = deviation(mesh, box(0.1, 0.1, 0.094).parts)
    assert found.gap_max == pytest.approx(0.006, abs=1e-5)
    assert found.excess_max < 1e-5


def test_deviation_ignores_what_lies_inside_another_part() -> None:
    whole = box(0.1, 0.1, 0.1)
    inner = box(0.02, 0.02, 0.02).moved(z=0.04)
    found = deviation(whole.mesh, (*whole.parts, *inner.parts))
    assert found.excess_max < 1e-5


def test_a_hull_over_a_cavity_shows_as_excess() -> None:
    cup = hollow([(0.04, 0.0), (0.04, 0.08)], wall=0.004, floor=0.004)
    found = deviation(Mesh(cup.mesh.vertices, cup.mesh.faces), (hull_part(cup.mesh.vertices),))
    assert found.excess_max > 0.03
