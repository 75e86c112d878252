"""The sensor against the published laws of the device, measured on its images."""

import numpy as np
import pytest
from sensor_laws import axial_sigma, depth_step, hidden_width, lateral_sigma, quantise
from sensor_scenes import FAR_AWAY, at_wall, from_above, plate, scenes

from bayesgrasp.depth import kinect
from bayesgrasp.depth.kinect import KinectConfig
from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.seeding import generator

BLOCK = plate(0.1, 0.1, 0.1, 0.15)


def wall_images(distance, tilt, n, rng):
    """True depth, published deviation, and n images of a bare wall."""
    camera = at_wall(distance, tilt)
    sensor, scene = DepthSensor([BLOCK], camera), scenes(n, (FAR_AWAY, 0, 0))
    true = sensor.render_clean(scene[:1])[0].astype(np.float64)
    rays = camera.rays()
    tilts = np.arccos(abs(rays @ camera.pose[2, :3]) / np.linalg.norm(rays, axis=-1))
    return true, axial_sigma(true, tilts), sensor.render(scene, None, rng)


def test_laws_have_the_published_values():
    depth = np.array([0.45, 0.6, 0.8, 1.0, 2.0])
    np.testing.assert_allclose(depth_step(depth) * 1e3, [0.58, 1.03, 1.84, 2.87, 11.5], rtol=5e-3)
    np.testing.assert_allclose(axial_sigma(depth, np.zeros(5)) * 1e3, [1.20, 1.28, 1.50, 1.88, 6.06], atol=6e-3)
    np.testing.assert_allclose(
        lateral_sigma(np.zeros(5)) * depth / 580 * 1e3, [0.62, 0.83, 1.10, 1.38, 2.76], atol=6e-3
    )
    assert hidden_width(580.0, 0.075, 0.6, 0.75) == pytest.approx(14.5)


@pytest.mark.parametrize("depth", [0.45, 0.8, 3.0])
@pytest.mark.parametrize("degrees", [0.0, 59.9, 60.1, 75.0, 85.0, 89.0])
def test_the_laws_that_run_are_the_published_ones(depth, degrees):
    tilt = np.deg2rad(degrees)
    steep = kinect.steep_sigma(kinect.DEPTH_CONSTANT / depth, np.cos(tilt))
    assert kinect.axial_sigma(depth, steep) == pytest.approx(float(axial_sigma(depth, tilt)), rel=1e-9)
    held = min(tilt, np.deg2rad(85.0))
    assert kinect.lateral_sigma(held) == pytest.approx(float(lateral_sigma(tilt)), rel=1e-9)
    returned = kinect.DEPTH_CONSTANT / kinect.quantised(kinect.DEPTH_CONSTANT / depth)
    assert returned == pytest.approx(float(quantise(depth)), rel=1e-12)


def test_steep_surfaces_are_noisier_beyond_60_degrees_only():
    tilt = np.deg2rad([0.0, 59.9, 60.1, 70.0])
    sigma = axial_sigma(np.full(4, 0.8), tilt)
    assert sigma[0] == sigma[1]
    steep = tilt[2:] ** 2 / (np.pi / 2 - tilt[2:]) ** 2
    np.testing.assert_allclose(sigma[2:] - sigma[0], 1e-4 / np.sqrt(0.8) * steep)


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0])
def test_a_flat_wall_shows_only_depths_of_the_device(distance):
    true, sigma, images = wall_images(distance, 0.0, 2, generator(0))
    disparity = 1091.5 - 348 / images[images > 0].astype(np.float64)
    np.testing.assert_allclose(disparity, np.rint(disparity), atol=1e-4)
    shown = np.unique(images[images > 0])
    assert len(shown) > 2
    np.testing.assert_allclose(np.diff(shown), depth_step(shown[:-1].astype(np.float64)), rtol=0.02)
    assert abs(images - true).max() < 6 * sigma.max() + depth_step(true).max()


@pytest.mark.parametrize("distance", [0.45, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("tilt", [0, 40, 65, 70])
def test_spread_of_depth_follows_the_published_law(distance, tilt):
    true, sigma, images = wall_images(distance, np.deg2rad(tilt), 16, generator(1))
    returned = images > 0
    error = ((images - true) / sigma)[returned]
    assert error.std() == pytest.approx(1.0, abs=0.05)
    assert abs(error.mean()) < 0.1
    assert returned.mean() > 0.9


def test_noise_is_unbiased_everywhere_and_independent_between_images():
    true, sigma, images = wall_images(0.8, 0.0, 200, generator(2))
    error = (images - true) / sigma
    assert abs(error.std(axis=0) - 1).max() < 0.3  # no pixel is quieter: 5 deviations of a spread over 200 images
    assert abs(np.mean(error[1:] * error[:-1])) < 0.02


def test_grazing_surfaces_return_less_and_less():
    returned = [(wall_images(0.8, np.deg2rad(tilt), 3, generator(3))[2] > 0).mean() for tilt in (65, 72, 77, 81)]
    assert returned[0] == 1
    assert sorted(returned, reverse=True) == returned
    assert returned[-1] < 0.4


def edges(images, rows=slice(205, 275)):
    """Per row: pixels of the block left and right of the middle of the image, and missing ones on either side."""
    near, missing = (images > 0) & (images < 0.68), images == 0
    return [part[:, rows, half].sum(-1) for part in (near, missing) for half in (slice(0, 320), slice(320, None))]


def test_shadow_is_on_one_side_and_as_wide_as_the_baseline_makes_it():
    exact = KinectConfig(lateral_gain=0.0)
    block, scene = from_above(0.75), scenes(2)
    _, _, left, right = edges(DepthSensor([BLOCK], block, exact).render(scene, None, generator(4)))
    assert (abs(left - 14.5) <= 0.5).all()
    assert (right == 0).all()
    mirrored = KinectConfig(lateral_gain=0.0, baseline=-0.075)
    _, _, left, right = edges(DepthSensor([BLOCK], block, mirrored).render(scene, None, generator(4)))
    assert (abs(right - 14.5) <= 0.5).all()
    assert (left == 0).all()


def test_without_shadow_and_noise_only_rounding_is_left():
    config = KinectConfig(shadow=False, lateral_gain=0.0, axial_gain=0.0, min_support=0.0)
    sensor = DepthSensor([BLOCK], from_above(0.7513), config)  # no depth at the border between two steps
    image, clean = sensor.render(scenes(1), None, generator(5)), sensor.render_clean(scenes(1))
    np.testing.assert_allclose(image, quantise(clean.astype(np.float64)), rtol=1e-6)


def test_edges_wander_as_published():
    sensor = DepthSensor([BLOCK], from_above(0.75))
    left, right, _, _ = edges(sensor.render(scenes(12), None, generator(6)))
    for width in (left, right):
        assert width.std() == pytest.approx(lateral_sigma(np.zeros(1))[0], abs=0.12)
        assert width.mean() == pytest.approx(48.3, abs=0.5)


@pytest.mark.parametrize("upright", [True, False])
@pytest.mark.parametrize(("pixels", "seen"), [(1.0, 0.0), (2.5, 0.0), (5.0, 0.85)])
def test_thin_rods_vanish(pixels, seen, upright):
    width, rng = pixels * 0.6 / 580, generator(7)
    rod = plate(width, 0.2, 0.14, 0.15) if upright else plate(0.2, width, 0.14, 0.15)
    sensor = DepthSensor([rod], from_above(0.75))
    scene = scenes(6)
    scene.object_pose[:, :2] = rng.uniform(-0.02, 0.02, (6, 2))
    image, on_rod = sensor.render(scene, None, rng), sensor.render_clean(scene) < 0.65
    assert ((image > 0) & (image < 0.65))[on_rod].mean() == pytest.approx(seen, abs=0.1)


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ({"window": 8}, "window"),
        ({"min_support": 1.5}, "min_support"),
        ({"axial_gain": -1.0}, "axial_gain"),
        ({"grazing_start": 1.5, "grazing_end": 1.4}, "grazing_start"),
        ({"noise_pitch": 0}, "noise_pitch"),
        ({"baseline": float("nan")}, "baseline"),
        ({"same_surface": 0.0}, "same_surface"),
    ],
)
def test_a_configuration_out_of_range_is_refused(setting, named):
    with pytest.raises(InvalidConfigurationError, match=named):
        KinectConfig(**setting)
