"""Parametric solids: volumes by formula, closed surfaces, parts that cover the mesh and leave cavities open."""

import numpy as np
import pytest

from bayesgrasp.meshes.deviation import deviation
from bayesgrasp.meshes.mesh import signed_volume
from bayesgrasp.objects.shapes import SEGMENTS, Solid, box, ellipsoid, handle, hollow, prism, turned, wedge

ROUND = SEGMENTS * np.sin(2 * np.pi / SEGMENTS) / 2  # area of the regular polygon over the square of its radius


def parts_volume(solid: Solid) -> float:
    return sum(signed_volume(part.vertices[part.faces]) for part in solid.parts)


@pytest.mark.parametrize(
    ("solid", "volume"),
    [
        (box(0.04, 0.05, 0.06), 0.04 * 0.05 * 0.06),
        (prism(0.04, 0.1, 6), 3 * np.sqrt(3) / 2 * 0.04**2 * 0.1),
        (wedge(0.12, 0.05, 0.06), 0.12 * 0.05 * 0.06 / 2),
        (turned([(0.03, 0.0), (0.03, 0.1)]), ROUND * 0.03**2 * 0.1),
        (turned([(0.03, 0.0), (0.03, 0.05), (0.01, 0.05 + 1e-9), (0.01, 0.1)]), ROUND * (0.03**2 + 0.01**2) * 0.05),
    ],
)
def test_volumes_by_formula(solid: Solid, volume: float) -> None:
    assert solid.mesh.volume == pytest.approx(volume, rel=1e-5)
    assert parts_volume(solid) == pytest.approx(volume, rel=1e-5)


def test_an_ellipsoid_is_close_to_the_true_one_and_flat_below() -> None:
    egg = ellipsoid(0.06, 0.05, 0.04)
    assert 0.92 < egg.mesh.volume / (np.pi / 6 * 0.06 * 0.05 * 0.04) < 1
    lowest = egg.mesh.vertices[:, 2].min()
    assert (egg.mesh.vertices[:, 2] < lowest + 1e-9).sum() > 8


def test_a_vessel_has_the_volume_of_its_walls_and_is_open() -> None:
    vessel = hollow([(0.04, 0.0), (0.04, 0.1)], wall=0.004, floor=0.006)
    walls = ROUND * (0.04**2 * 0.1 - 0.036**2 * 0.094)
    assert vessel.mesh.volume == pytest.approx(walls, rel=1e-6)
    assert vessel.mesh.to_trimesh().is_watertight
    axis = np.array([[0.0, 0.0, z] for z in (0.007, 0.05, 0.1)])
    assert min(part.depth(axis).min() for part in vessel.parts) > 0.0009
    found = deviation(vessel.mesh, vessel.parts)
    assert found.gap_max < 1e-9
    assert found.excess_max < 0.04 * (1 - np.cos(np.pi / 10)) + 1e-3


def test_only_concave_steps_of_a_profile_are_cut() -> None:
    assert len(turned([(0.02, 0.0), (0.03, 0.01), (0.03, 0.1), (0.02, 0.12)]).parts) == 1
    assert len(turned([(0.03, 0.0), (0.03, 0.05), (0.01, 0.07), (0.01, 0.1)]).parts) == 2
    assert len(turned([(0.03, 0.0), (0.03, 0.01), (0.01, 0.02), (0.01, 0.05), (0.03, 0.06), (0.03, 0.07)]).parts) == 3


def test_a_handle_leaves_room_for_a_finger() -> None:
    ring = handle(distance=0.04, bottom=0.02, top=0.08, reach=0.03, thickness=0.008)
    hole = np.array([[0.048, 0.0, 0.05]])
    assert min(part.depth(hole).min() for part in ring.parts) > 0.005
    assert ring.mesh.vertices[:, 0].max() == pytest.approx(0.04 + 0.03 + 0.004, abs=0.002)


def test_moving_and_joining() -> None:
    both = box(0.02, 0.02, 0.02) + box(0.02, 0.02, 0.02).moved(x=0.1, z=0.05)
    assert len(both.parts) == 2
    assert both.mesh.volume == pytest.approx(16e-6)
    np.testing.assert_allclose(both.mesh.extents, [0.12, 0.02, 0.07])
