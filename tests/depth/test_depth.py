"""The depth sensor: exact geometry, the fast path, nuisances, and reproducibility."""

from dataclasses import replace

import numpy as np
import pytest
from sensor_scenes import (
    KINECT,
    Shape,
    cast_depth,
    from_above,
    plate,
    random_cameras,
    random_scenes,
    scan,
    scenes,
)

from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.errors import AssetError, DepthImageError, InvalidConfigurationError
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.geometry.camera_nuisances import disturbed_camera
from bayesgrasp.objects import household, ycb
from bayesgrasp.observation.preprocess import preprocess
from bayesgrasp.seeding import generator


@pytest.fixture(scope="module")
def objects():
    solids = [household.OBJECTS[name].build().mesh for name in sorted(household.OBJECTS)[:4]]
    return [Shape(solid.vertices, solid.faces) for solid in solids]


def assert_exact(shape, rng, views=1, rays=60):
    """Depths within 0.01 mm of the independent caster, at random poses, scales, cameras and pixels of the object."""
    sensor = DepthSensor([shape])
    for _ in range(views):
        scene, nuisance = random_scenes(1, 1, rng), random_cameras(1, rng)
        image = sensor.render_clean(scene, nuisance)[0]
        camera = disturbed_camera(sensor.camera, nuisance, 0)
        middle = camera.project(np.append(scene.object_pose[0, :2], np.ptp(shape.vertices[:, 2]) / 2))[0]
        size = 580 * np.linalg.norm(np.ptp(shape.vertices, axis=0)) / 0.7 / 2
        u, v = np.rint(middle + rng.uniform(-size, size, (rays, 2))).clip(0, (639, 479)).astype(int).T
        expected = cast_depth(shape, scene, camera, np.stack([u, v], axis=1).astype(float))
        np.testing.assert_allclose(image[v, u], expected, atol=1e-5)


def test_household_objects_are_seen_exactly():
    for i, name in enumerate(sorted(household.OBJECTS)):
        solid = household.OBJECTS[name].build().mesh
        assert_exact(Shape(solid.vertices, solid.faces), generator(0, i))


def test_scans_are_seen_exactly_as_they_are(ycb_dir):
    for i, path in enumerate(ycb.scans(ycb_dir).values()):
        assert_exact(scan(path), generator(1, i))


def test_winding_does_not_matter(objects):
    scene = random_scenes(3, 1, generator(2))
    out, inward = DepthSensor(objects[:1]), DepthSensor([objects[0].wound_inwards])
    np.testing.assert_array_equal(out.render_clean(scene), inward.render_clean(scene))
    np.testing.assert_array_equal(out.render(scene, None, generator(3)), inward.render(scene, None, generator(3)))


def test_fast_path_gives_the_preprocessed_image(objects):
    rng = generator(4)
    scene, cameras, sensor = random_scenes(8, len(objects), rng), random_cameras(8, rng), DepthSensor(objects)
    fast = sensor.images(scene, cameras, generator(5))
    np.testing.assert_array_equal(fast, preprocess(sensor.render(scene, cameras, generator(5))))
    assert fast.shape == (8, 160, 256)
    values = fast[fast > 0]
    assert values.min() >= np.float32(0.45)
    assert values.max() <= np.float32(1.0)


def test_the_generator_decides_the_noise(objects):
    sensor, scene = DepthSensor(objects), random_scenes(2, len(objects), generator(6))
    first = sensor.images(scene, None, generator(7))
    np.testing.assert_array_equal(first, sensor.images(scene, None, generator(7)))
    again = sensor.images(scene, None, generator(8))
    assert (first != again).mean() > 0.3
    one_by_one = generator(7)
    parts = [sensor.images(scene[i : i + 1], None, one_by_one) for i in range(2)]
    np.testing.assert_array_equal(first, np.concatenate(parts))


def test_near_and_far_bound_the_returns(objects):
    cameras = random_cameras(1, generator(9))
    cameras = replace(cameras, near=np.array([0.6], np.float32), far=np.array([0.7], np.float32))
    image = DepthSensor(objects).render(scenes(1), cameras, generator(10))
    assert (image > 0).any()
    assert image[image > 0].min() >= 0.6
    assert image[image > 0].max() <= 0.7


def test_a_wider_field_of_view_makes_objects_smaller():
    sensor, cameras = DepthSensor([plate(0.2, 0.1, 0.1, 0.15)], from_above(0.75)), random_cameras(3, generator(11))
    still = replace(cameras, position_offset=cameras.position_offset * 0, rotation_vector=cameras.rotation_vector * 0)
    factors = np.array([0.9, 1.0, 1.1], np.float32)
    images = sensor.render_clean(scenes(3), replace(still, field_of_view_factor=factors))
    widths = (images < 0.65).any(axis=1).sum(axis=1)
    angle = np.arctan(320 / 580)
    np.testing.assert_allclose(widths, 0.2 / 0.6 * 320 / np.tan(angle * factors), atol=1.5)


def test_a_disturbed_camera_is_the_stated_one():
    nuisance = random_cameras(1, generator(12))
    camera, nominal = disturbed_camera(canonical_camera(), nuisance, 0), canonical_camera()
    np.testing.assert_allclose(camera.pose[:3, 3] - nominal.pose[:3, 3], nuisance.position_offset[0], atol=1e-7)
    turn = nominal.pose[:3, :3].T @ camera.pose[:3, :3]
    skew = (turn - turn.T) / 2  # to first order in a small angle
    np.testing.assert_allclose([skew[2, 1], skew[0, 2], skew[1, 0]], nuisance.rotation_vector[0], atol=1e-5)


def test_objects_out_of_view_or_around_the_camera_do_no_harm(objects):
    sensor = DepthSensor(objects)
    away = sensor.render(scenes(1, (30.0, 0.0, 0.0)), None, generator(13))
    assert (away > 0).all()
    around = sensor.render(scenes(1, (0.4, 0.0, 0.0), scale=20.0), None, generator(14))
    assert np.isfinite(around).all()


def test_a_low_camera_sees_no_return_above_the_horizon():
    low = KINECT.with_pose(from_above(0.75).pose @ _pitch(np.deg2rad(80)))
    image = DepthSensor([plate(0.1, 0.1, 0.0, 0.1)], low).render(scenes(1), None, generator(15))[0]
    assert image.max() > 0
    assert (image[:100] == 0).all()


def _pitch(angle):
    turn = np.eye(4)
    turn[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn


def test_what_cannot_be_rendered_is_refused(objects):
    sensor = DepthSensor(objects)
    with pytest.raises(InvalidConfigurationError, match="4 objects"):
        sensor.images(scenes(1, index=4), None, generator(0))
    with pytest.raises(InvalidConfigurationError, match="as many cameras"):
        sensor.images(scenes(2), random_cameras(1, generator(0)), generator(0))
    wide = replace(random_cameras(1, generator(0)), field_of_view_factor=np.array([5.0], np.float32))
    with pytest.raises(InvalidConfigurationError, match="field_of_view_factor"):
        sensor.images(scenes(1), wide, generator(0))
    with pytest.raises(DepthImageError, match="640x480"):
        DepthSensor(objects, from_above(0.7, 64, 64)).images(scenes(1), None, generator(0))
    with pytest.raises(DepthImageError, match="camera_to_world"):
        DepthSensor(objects, KINECT)
    with pytest.raises(AssetError, match="positive area"):
        DepthSensor([Shape(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))])
    with pytest.raises(AssetError, match="finite"):
        DepthSensor([Shape(np.full((3, 3), np.nan), np.array([[0, 1, 2]], np.int32))])
