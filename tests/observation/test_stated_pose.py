"""The table in the image against the stated pose of the camera."""

import numpy as np
import pytest
from box_scene import Box, box_depth_image
from scipy.spatial.transform import Rotation

from bayesgrasp.geometry.camera import Camera, canonical_camera, look_at
from bayesgrasp.observation.stated_pose import see_table
from bayesgrasp.seeding import generator

CAMERA = canonical_camera()
BOX = Box(x=0.02, y=-0.03, size=(0.10, 0.08, 0.12))


def misstated(camera: Camera, turn: tuple[float, float, float], shift: tuple[float, float, float]) -> Camera:
    """The camera with a pose turned in the world frame (degrees) about its own centre, and shifted (metres)."""
    pose = camera.pose.copy()
    pose[:3, :3] = Rotation.from_rotvec(turn, degrees=True).as_matrix() @ pose[:3, :3]
    pose[:3, 3] += shift
    return camera.with_pose(pose)


def image_of(camera: Camera, seed: int = 0) -> np.ndarray:
    depth = box_depth_image(camera, (BOX,))
    noise = 0.002 * generator(seed).standard_normal(depth.shape)
    return np.where(depth > 0, depth + noise, 0.0).astype(np.float32)


@pytest.mark.parametrize("eye", [(0.4, 0.0, 0.7), (0.05, 0.0, 0.9), (0.75, 0.2, 0.3)])
@pytest.mark.parametrize("turn", [(2.0, 0.0, 0.0), (0.0, -5.0, 0.0), (3.0, 3.0, 0.0), (0.0, 0.0, 0.0)])
@pytest.mark.parametrize("height", [0.02, -0.02, 0.0])
def test_tilt_and_height_are_seen_and_corrected(eye, turn, height) -> None:
    true = CAMERA.with_pose(look_at(np.array(eye), np.array([0.0, 0.0, 0.03])))
    seen = see_table(image_of(true), misstated(true, turn, (0.0, 0.0, height)), generator(4))
    assert seen is not None
    assert np.degrees(seen.tilt) == pytest.approx(np.linalg.norm(turn), abs=0.15)
    # Stated too high, the camera puts the table too high.
    assert seen.height == pytest.approx(height, abs=0.002)
    np.testing.assert_allclose(seen.camera_to_world, true.pose, atol=0.004)


def test_what_a_plane_does_not_show_stays_as_stated() -> None:
    stated = misstated(CAMERA, (0.0, 0.0, 3.0), (0.02, -0.01, 0.0))
    seen = see_table(image_of(CAMERA), stated, generator(4))
    assert seen is not None
    assert np.degrees(seen.tilt) < 0.15
    assert abs(seen.height) < 0.002
    np.testing.assert_allclose(seen.camera_to_world, stated.pose, atol=0.004)


def test_the_correction_never_turns_about_the_vertical() -> None:
    seen = see_table(image_of(CAMERA), misstated(CAMERA, (4.0, -2.0, 1.5), (0.0, 0.0, 0.01)), generator(4))
    assert seen is not None
    left = seen.camera_to_world[:3, :3] @ CAMERA.pose[:3, :3].T
    assert np.degrees(Rotation.from_matrix(left).magnitude()) == pytest.approx(1.5, abs=0.2)


@pytest.mark.parametrize("turn", [(25.0, 0.0, 0.0), (0.0, -20.0, 0.0)])
def test_a_pose_that_is_far_off_has_no_table(turn) -> None:
    assert see_table(image_of(CAMERA), misstated(CAMERA, turn, (0.0, 0.0, 0.0)), generator(4)) is None


def test_noise_has_no_table() -> None:
    noise = generator(2).uniform(0.4, 1.5, (480, 640)).astype(np.float32)
    assert see_table(noise, CAMERA, generator(3)) is None
    assert see_table(np.zeros((480, 640), np.float32), CAMERA, generator(3)) is None
    constant = np.full((480, 640), 0.8, np.float32)
    assert see_table(constant, CAMERA, generator(3)) is None, "a wall across the view"
