"""What is read from an image without a network: objects, the table, and whether the image is familiar."""

import numpy as np
import pytest
from box_scene import Box, box_depth_image
from scipy.spatial.transform import Rotation

from bayesgrasp.errors import CheckpointError, DepthImageError, InvalidConfigurationError
from bayesgrasp.geometry.camera import canonical_camera, look_at
from bayesgrasp.observation.familiarity import Familiarity, fit_familiarity
from bayesgrasp.observation.preprocess import preprocess
from bayesgrasp.observation.surface import SurfaceConfig, SurfaceReader, heights
from bayesgrasp.observation.table import TableConfig, locate_workspace
from bayesgrasp.seeding import generator

CAMERA = canonical_camera()
SMALL = CAMERA.resized(256, 160)
READER = SurfaceReader(SMALL)


def preprocess_small(depth: np.ndarray) -> np.ndarray:
    """What `preprocess` does to depths; the size is already the network's."""
    return np.where((depth >= 0.45) & (depth <= 1.0), depth, np.float32(0.0))


def noisy(depth: np.ndarray, rng: np.random.Generator, sigma: float = 0.0015) -> np.ndarray:
    return np.where(depth > 0, depth + sigma * rng.standard_normal(depth.shape), 0.0).astype(np.float32)


def test_the_object_is_found_where_it_stands() -> None:
    box = Box(x=0.03, y=-0.04, yaw=0.3, size=(0.06, 0.06, 0.15))
    surface = READER.read(preprocess(box_depth_image(CAMERA, (box,))))
    assert surface.problem() is None
    np.testing.assert_allclose(surface.center, (0.03, -0.04), atol=0.015)
    assert surface.item_points[:, 2].max() == pytest.approx(0.15, abs=0.002)
    assert np.abs(surface.near()[:, :2]).max() < 0.3


def test_of_two_objects_the_nearer_one_is_meant() -> None:
    surface = READER.read(preprocess(box_depth_image(CAMERA, (Box(y=0.02), Box(y=-0.2)))))
    np.testing.assert_allclose(surface.center, (0.0, 0.02), atol=0.02)


def test_reasons_in_words() -> None:
    empty = READER.read(preprocess(box_depth_image(CAMERA)))
    assert "nothing on the table" in str(empty.problem())
    far = READER.read(preprocess(box_depth_image(CAMERA, (Box(y=0.25),))))
    assert "outside the workspace" in str(far.problem())
    assert "(0.00, 0.25)" in str(far.problem()) or "0.2" in str(far.problem())
    blind = READER.read(np.zeros((160, 256), np.float32))
    assert "does not see" in str(blind.problem())


@pytest.mark.parametrize(("lift", "tilt"), [(0.014, 0.0), (0.004, 0.02), (-0.012, -0.015)])
def test_a_camera_off_its_stated_pose_makes_no_object_of_the_table(lift, tilt) -> None:
    pose = CAMERA.pose.copy()
    pose[2, 3] -= lift
    pose[:3, :3] = Rotation.from_rotvec([tilt, 0.0, 0.0]).as_matrix() @ pose[:3, :3]
    depth = noisy(box_depth_image(CAMERA.with_pose(pose), (Box(x=0.03, y=-0.02),)), generator(7))
    surface = READER.read(preprocess(depth))
    assert surface.problem() is None
    np.testing.assert_allclose(surface.center, (0.03, -0.02), atol=0.03)
    raised = surface.raised_points()
    assert np.abs(raised[:, :2] - surface.center).max() < 0.15
    assert np.percentile(raised[:, 2], 98) == pytest.approx(0.12, abs=0.006)
    assert heights(surface.near(), surface.table).min() > -0.012
    assert READER.read(preprocess(box_depth_image(CAMERA.with_pose(pose)))).problem().startswith("nothing on the table")


def test_of_an_exact_camera_the_table_is_flat() -> None:
    np.testing.assert_allclose(READER.read(preprocess(box_depth_image(CAMERA, (Box(),)))).table, 0.0, atol=1e-4)


@pytest.mark.parametrize(("sigma", "thickness"), [(0.0008, 0.006), (0.0015, 0.0063), (0.004, 0.012)])
def test_what_counts_as_the_table_follows_the_noise(sigma, thickness) -> None:
    """A ruler of 9 mm is found where the noise allows it."""
    ruler = Box(x=0.02, y=-0.03, yaw=0.4, size=(0.03, 0.16, 0.009))
    surface = READER.read(preprocess(noisy(box_depth_image(CAMERA, (ruler,)), generator(11), sigma)))
    assert surface.thickness == pytest.approx(thickness, rel=0.1)
    if surface.thickness < 0.009:
        np.testing.assert_allclose(surface.center, (0.02, -0.03), atol=0.015)


@pytest.mark.parametrize("sigma", [0.0008, 0.0015, 0.003, 0.006])
def test_noise_alone_is_no_object(sigma) -> None:
    for seed in range(5):
        assert not READER.read(preprocess(noisy(box_depth_image(CAMERA), generator(12, seed), sigma))).item.any()


def test_specks_are_not_objects() -> None:
    speck = READER.read(preprocess(box_depth_image(CAMERA, (Box(size=(0.008, 0.008, 0.03)),))))
    assert "nothing on the table" in str(speck.problem())


@pytest.mark.parametrize("eye", [(0.5, 0.0, 0.6), (-0.2, 0.35, 0.7), (0.02, -0.03, 0.8), (0.0, -0.7, 0.4)])
def test_table_and_object_are_found_without_a_pose(eye) -> None:
    pose = look_at(np.array(eye), np.array([0.05, 0.02, 0.0]))
    camera = CAMERA.with_pose(pose)
    depth = noisy(box_depth_image(camera, (Box(x=0.06, y=0.03),)), generator(0))
    found = locate_workspace(depth, camera.with_pose(None), generator(1))
    up = pose[:3, :3] @ np.linalg.inv(found)[:3, 2]
    assert up[2] > np.cos(np.radians(1.5))
    assert found[2, 3] == pytest.approx(eye[2], abs=0.01)
    origin = pose @ np.linalg.inv(found) @ np.array([0.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(origin[:3], (0.06, 0.03, 0.0), atol=0.03)
    # The camera is on the +x side of the frame that was found.
    towards = found[:3, :3] @ np.array([0.0, 1.0, -1.0])
    assert towards[0] > 0
    assert abs(towards[1]) < 1e-6


@pytest.mark.parametrize("absurd", [19.0, 1e4, 1e30])
def test_one_percent_of_absurd_depths_does_not_hide_the_table(absurd) -> None:
    camera = CAMERA.resized(160, 120)
    depth = box_depth_image(camera, (Box(x=0.03),))
    clean = locate_workspace(depth, camera, generator(8))
    for seed in range(40):
        rng = generator(8, seed)
        spoilt = np.where(rng.random(depth.shape) < 0.01, np.float32(absurd), depth)
        found = locate_workspace(spoilt, camera.with_pose(None), rng)
        np.testing.assert_allclose(found[2], clean[2], atol=0.003)


def test_what_reaches_over_the_border_is_not_the_object() -> None:
    camera = CAMERA
    boxes = (Box(x=-0.02, y=0.04, size=(0.05, 0.05, 0.05)), Box(x=0.42, y=0.0, size=(0.4, 0.15, 0.1)))
    found = locate_workspace(box_depth_image(camera, boxes), camera, generator(6))
    origin = camera.pose @ np.linalg.inv(found) @ np.array([0.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(origin[:2], (-0.02, 0.04), atol=0.02)


def test_an_image_without_a_plane_is_refused() -> None:
    camera = CAMERA.with_pose(None)
    clutter = generator(2).uniform(0.4, 1.5, (480, 640)).astype(np.float32)
    with pytest.raises(DepthImageError, match="no table found"):
        locate_workspace(clutter, camera, generator(3))
    with pytest.raises(DepthImageError, match="too few"):
        locate_workspace(np.zeros((480, 640), np.float32), camera, generator(3))


@pytest.fixture(scope="module")
def training():
    """Surfaces of boxes at random places, and what they have in common."""
    rng = generator(4)
    surfaces = []
    for _ in range(220):
        x, y = rng.uniform(-0.05, 0.05, 2)
        box = Box(x, y, rng.uniform(0, 3), tuple(rng.uniform((0.03, 0.05, 0.05), (0.08, 0.15, 0.2))))
        surfaces.append(READER.read(preprocess_small(noisy(box_depth_image(SMALL, (box,)), rng))))
    return surfaces, fit_familiarity(surfaces[:200], false_alarms=0.02)


def test_training_images_are_familiar_and_others_are_not(training) -> None:
    surfaces, familiarity = training
    held_out = [familiarity.distance(s) / familiarity.threshold for s in surfaces[200:]]
    assert np.median(held_out) < 0.8
    tilted = CAMERA.with_pose(look_at(np.array([0.40, 0.0, 0.75]), np.array([0.02, 0.0, 0.07])))
    huge = box_depth_image(CAMERA, (Box(size=(0.25, 0.3, 0.3)),))
    coarse = noisy(box_depth_image(CAMERA, (Box(),)), generator(5), 0.008)
    for depth in (box_depth_image(tilted, (Box(),)), huge, coarse):
        surface = READER.read(preprocess(depth))
        assert familiarity.distance(surface) > familiarity.threshold
        assert "in training mostly" in familiarity.strangest(surface)


def test_familiarity_survives_the_card_and_other_cards_are_refused(training) -> None:
    surfaces, familiarity = training
    again = Familiarity.from_dict(familiarity.to_dict())
    assert again.distance(surfaces[0]) == familiarity.distance(surfaces[0])
    with pytest.raises(CheckpointError, match="another version"):
        Familiarity.from_dict({**familiarity.to_dict(), "statistics": ["height"]})
    with pytest.raises(CheckpointError, match="cannot be read"):
        Familiarity.from_dict({})


def test_wrong_configurations_are_refused(training) -> None:
    with pytest.raises(InvalidConfigurationError, match="200 images"):
        fit_familiarity(training[0][:10])
    with pytest.raises(InvalidConfigurationError):
        SurfaceConfig(workspace=0.5)
    with pytest.raises(InvalidConfigurationError):
        TableConfig(tolerance=0.02)


def test_what_stands_away_from_the_object_is_cleared() -> None:
    alone = preprocess(box_depth_image(CAMERA, (Box(),)))
    crowded = preprocess(box_depth_image(CAMERA, (Box(), Box(y=0.3), Box(x=-0.3, y=-0.2, size=(0.05, 0.05, 0.05)))))
    crowded[5:20, 5:20] = 0.0
    cleared = READER.cleared(crowded, READER.read(crowded))
    # The feet of what stood there are as low as a table may seem to a camera that is slightly off its stated pose.
    assert (np.abs(crowded - alone) > 0.005).mean() > 0.03
    assert (np.abs(cleared - alone) > 0.005).mean() < 0.01
    np.testing.assert_array_equal(READER.cleared(alone, READER.read(alone)), alone)
    empty = preprocess(box_depth_image(CAMERA))
    np.testing.assert_array_equal(READER.cleared(empty, READER.read(empty)), empty)
