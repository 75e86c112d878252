"""The stereo sensor against its laws, measured on its images."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm
from sensor_laws import hidden_width, stereo_sigma
from sensor_scenes import FAR_AWAY, at_wall, from_above, plate, random_cameras, random_scenes, scenes

from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.depth.stereo import StereoConfig
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.observation.preprocess import preprocess
from bayesgrasp.seeding import generator

BLOCK = plate(0.1, 0.1, 0.1, 0.15)
TRUE_WIDTH = 48.3  # of half the block, px
EVEN = StereoConfig(texture_spread=0.0)
EXACT = replace(EVEN, subpixel=0.0, fattening_spread=0.0)


def wall(config, distance, tilt=0.0, n=8):
    """True depth and n images of a bare wall; at the right border there is none."""
    sensor, scene = DepthSensor([BLOCK], at_wall(distance, tilt, 160), config), scenes(n, (FAR_AWAY, 0, 0))
    return sensor.render_clean(scene[:1])[0].astype(np.float64), sensor.render(scene, None, generator(1))


def sides(images, rows=slice(205, 275)):
    """Per row: pixels of the block left and right of the middle of the image, and missing ones on either side."""
    near, missing = (images > 0) & (images < 0.68), images == 0
    halves = (slice(200, 320), slice(320, 440))
    return [part[:, rows, half].sum(-1) for part in (near, missing) for half in halves]


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0])
def test_spread_of_depth_grows_with_its_square(distance):
    true, images = wall(EVEN, distance)
    seen = images > 0
    error = (images - true)[seen]
    assert error.std() == pytest.approx(stereo_sigma(EVEN, distance), rel=0.06)
    assert abs(error.mean()) < 0.1 * error.std()


def test_disparities_come_in_steps():
    _, images = wall(EVEN, 1.0, n=1)
    steps = 32 * 580 * 0.055 / images[images > 0].astype(np.float64)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-3)


@pytest.mark.parametrize("degrees", [0, 40, 60])
def test_weak_texture_has_no_depth(degrees):
    config, tilt = StereoConfig(), np.deg2rad(degrees)
    _, images = wall(config, 0.9, tilt, n=20)
    middle = images[:, 60:100, :100]  # a tilt of its own, and seen by both cameras
    expected = norm.cdf(-np.log(config.weakest * np.cos(tilt)) / config.texture_spread)
    assert (middle == 0).mean() == pytest.approx(expected, rel=0.35, abs=0.003)


def test_holes_are_on_the_other_side_than_those_of_a_kinect():
    config = replace(EXACT, fattening=0.5)
    _, _, left, right = sides(DepthSensor([BLOCK], from_above(0.75), config).render(scenes(4), None, generator(2)))
    assert (left == 0).all()
    assert right.mean() == pytest.approx(hidden_width(580.0, config.baseline, 0.6, 0.75), abs=0.6)
    mirrored = replace(config, baseline=0.055)
    _, _, left, right = sides(DepthSensor([BLOCK], from_above(0.75), mirrored).render(scenes(4), None, generator(2)))
    assert (right == 0).all()
    assert left.mean() > 9


def test_the_nearer_surface_grows_over_its_edges():
    images = DepthSensor([BLOCK], from_above(0.75), EVEN).render(scenes(12), None, generator(3))
    for width in sides(images)[:2]:
        assert TRUE_WIDTH + 1 < width.mean() < TRUE_WIDTH + 3
        assert 0.4 < width.std() < 2


def test_a_border_of_the_image_is_not_seen_by_both_cameras():
    image = DepthSensor([BLOCK], from_above(0.75), EXACT).render(scenes(1), None, generator(4))[0]
    missing = (image == 0)[:100]  # above the block
    assert (missing.sum(axis=1) == np.ceil(580 * 0.055 / 0.75)).all()
    assert missing[:, -1].all()


def test_without_noise_only_rounding_is_left():
    sensor = DepthSensor([BLOCK], from_above(0.7513), EXACT)
    image, clean = sensor.render(scenes(1), None, generator(5)), sensor.render_clean(scenes(1)).astype(np.float64)
    middle = np.s_[:, 210:270, 290:350]
    np.testing.assert_allclose(image[middle], clean[middle], atol=0.5 / 32 / 31.9)


@pytest.mark.parametrize(("pixels", "seen"), [(1.0, 0.0), (6.0, 0.9)])
def test_thin_rods_vanish(pixels, seen):
    width, rng = pixels * 0.6 / 580, generator(7)
    sensor = DepthSensor([plate(width, 0.2, 0.14, 0.15)], from_above(0.75), EVEN)
    scene = scenes(6)
    scene.object_pose[:, :2] = rng.uniform(-0.02, 0.02, (6, 2))
    image, on_rod = sensor.render(scene, None, rng), sensor.render_clean(scene) < 0.65
    assert ((image > 0) & (image < 0.65))[on_rod].mean() == pytest.approx(seen, abs=0.1)


def test_fast_path_gives_the_preprocessed_image():
    rng = generator(8)
    scene, cameras, sensor = random_scenes(4, 1, rng), random_cameras(4, rng), DepthSensor([BLOCK], config=EVEN)
    fast = sensor.images(scene, cameras, generator(9))
    np.testing.assert_array_equal(fast, preprocess(sensor.render(scene, cameras, generator(9))))
    assert not np.array_equal(fast, sensor.images(scene, cameras, generator(10)))


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ({"window": 8}, "window"),
        ({"baseline": 0.0}, "baseline"),
        ({"step": 0.0}, "step"),
        ({"subpixel": -1.0}, "subpixel"),
        ({"fattening": 1.5}, "fattening"),
        ({"texture_pitch": 0}, "texture_pitch"),
    ],
)
def test_a_configuration_out_of_range_is_refused(setting, named):
    with pytest.raises(InvalidConfigurationError, match=named):
        StereoConfig(**setting)
