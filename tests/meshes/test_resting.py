"""Resting poses: known ones, the physics of toppling, and scans that bulge below."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bayesgrasp.meshes.convex import ConvexPart, hull_part
from bayesgrasp.meshes.mass import mass_properties
from bayesgrasp.meshes.resting import flatten, rest, rotation_between, safe_tilt, settle
from bayesgrasp.objects.shapes import Solid, box, ellipsoid, prism, turned, wedge
from bayesgrasp.seeding import generator


def turned_by(solid: Solid, rotation: Rotation) -> tuple[ConvexPart, ...]:
    return tuple(ConvexPart(rotation.apply(part.vertices), part.faces) for part in solid.parts)


def corners(parts: tuple[ConvexPart, ...], pose: np.ndarray) -> np.ndarray:
    return np.concatenate([part.vertices for part in parts]) @ pose[:3, :3].T + pose[:3, 3]


@pytest.mark.parametrize("solid", [box(0.05, 0.08, 0.1), prism(0.04, 0.1, 6), wedge(0.12, 0.06, 0.06)])
def test_a_standing_solid_only_moves_over_the_origin(solid: Solid) -> None:
    moved = solid.moved(x=0.3, y=-0.2, z=0.5).parts
    pose = settle(moved, mass_properties(moved)[0])
    np.testing.assert_allclose(pose[:3, :3], np.eye(3), atol=1e-12)
    placed = corners(moved, pose)
    assert placed[:, 2].min() == 0.0
    center = mass_properties(
        tuple(ConvexPart(part.vertices @ pose[:3, :3].T + pose[:3, 3], part.faces) for part in moved)
    )[0]
    np.testing.assert_allclose(center[:2], 0, atol=1e-12)


@pytest.mark.parametrize("angle", [5.0, 15.0, 25.0])
@pytest.mark.parametrize("azimuth", [0.0, 40.0, 200.0])
def test_a_tilted_box_falls_back_onto_its_base(angle: float, azimuth: float) -> None:
    axis = np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0])
    parts = turned_by(box(0.08, 0.09, 0.1), Rotation.from_rotvec(np.radians(angle) * axis))
    placed = corners(parts, settle(parts, mass_properties(parts)[0]))
    assert placed[:, 2].max() == pytest.approx(0.1, abs=1e-9)
    assert (placed[:, 2] < 1e-9).sum() == 4


def test_beyond_the_tipping_angle_it_falls_over() -> None:
    tipping = np.degrees(np.arctan2(0.04, 0.2))
    for angle, height in ((tipping - 2, 0.2), (tipping + 2, 0.04)):
        parts = turned_by(box(0.04, 0.06, 0.2), Rotation.from_euler("y", angle, degrees=True))
        placed = corners(parts, settle(parts, mass_properties(parts)[0]))
        assert placed[:, 2].max() == pytest.approx(height, abs=1e-9)


def test_any_start_ends_in_a_stable_rest_with_a_lower_centre_of_mass() -> None:
    rng = generator(3)
    for _ in range(30):
        part = hull_part(rng.normal(size=(20, 3)) * (0.03, 0.05, 0.08))
        center = mass_properties((part,))[0]
        pose = settle((part,), center)
        placed = corners((part,), pose)
        height = (pose[:3, :3] @ center + pose[:3, 3])[2]
        assert height <= center[2] - part.vertices[:, 2].min() + 1e-12
        assert (placed[:, 2] < 1e-9).sum() >= 3
        assert safe_tilt((part,), pose) >= 0
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)


def test_a_round_base_stands_up_again() -> None:
    parts = turned_by(ellipsoid(0.08, 0.08, 0.05), Rotation.from_euler("x", 20, degrees=True))
    pose = settle(parts, mass_properties(parts)[0])
    assert corners(parts, pose)[:, 2].max() < 0.052


def bulging_bottle() -> tuple[ConvexPart, ...]:
    """A tall cylinder on a ridge of 2 mm, which topples."""
    body = turned([(0.03, 0.002), (0.03, 0.25)]).parts[0]
    ridge = np.array([[-0.001, y, 0.0] for y in (-0.03, 0.03)] + [[0.001, y, 0.0] for y in (-0.03, 0.03)])
    return (hull_part(np.concatenate([body.vertices, ridge])),)


def test_a_bulging_underside_is_flattened_until_it_stands() -> None:
    parts = bulging_bottle()
    assert safe_tilt(parts, settle(parts, mass_properties(parts)[0])) < np.radians(1)
    resting = rest(parts)
    assert safe_tilt(resting.parts, resting.mesh_to_object) > np.radians(4.9)
    assert resting.mesh_to_object[2, 2] > np.cos(np.radians(1))
    placed = corners(resting.parts, resting.mesh_to_object)
    assert placed[:, 2].max() > 0.24
    mesh = resting.place(np.concatenate([part.vertices for part in parts]))
    assert mesh[:, 2].min() == pytest.approx(0, abs=1e-9)


def test_what_does_not_stand_is_not_made_to_stand() -> None:
    cone = hull_part(np.concatenate([[[0.0, 0, 0]], turned([(0.03, 0.12), (0.03, 0.125)]).parts[0].vertices]))
    resting = rest((cone,))
    assert resting.floor == -np.inf
    assert resting.mesh_to_object[2, 2] < 0.5


def test_flattening_raises_only_what_is_below() -> None:
    (flat,) = flatten(box(0.05, 0.05, 0.1).parts, 0.01)
    assert flat.vertices[:, 2].min() == pytest.approx(0.01)
    assert flat.vertices[:, 2].max() == pytest.approx(0.1)
    assert flatten(box(0.05, 0.05, 0.1).parts, 0.2) == ()


def test_safe_tilt_of_a_box() -> None:
    parts = box(0.06, 0.2, 0.1).parts
    assert safe_tilt(parts, np.eye(4)) == pytest.approx(np.arctan2(0.03, 0.05))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-9, np.pi])
def test_rotation_between_unit_vectors(angle: float) -> None:
    for axis in np.eye(3):
        start = np.roll(axis, 1)
        end = Rotation.from_rotvec(angle * axis).apply(start)
        rotation = rotation_between(start, end)
        np.testing.assert_allclose(rotation @ start, end, atol=1e-7)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-7)
        assert np.linalg.det(rotation) == pytest.approx(1)


def test_mass_properties_of_a_box_and_of_its_halves() -> None:
    expected = np.diag([0.06**2 + 0.1**2, 0.04**2 + 0.1**2, 0.04**2 + 0.06**2]) / 12
    whole = box(0.04, 0.06, 0.1).parts
    halves = box(0.04, 0.06, 0.05).parts + box(0.04, 0.06, 0.05).moved(z=0.05).parts
    for parts in (whole, halves):
        center, inertia = mass_properties(parts)
        np.testing.assert_allclose(center, [0, 0, 0.05], atol=1e-12)
        np.testing.assert_allclose(inertia, expected, atol=1e-12)
