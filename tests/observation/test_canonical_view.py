"""Re-projection into the canonical camera and into a map: rendered scenes from 20 viewpoints, and real images."""

import numpy as np
import pytest
from PIL import Image
from sensor_scenes import Shape, plate, random_scenes, scenes

from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.errors import DepthImageError, InvalidConfigurationError
from bayesgrasp.geometry.camera import Camera, canonical_camera, look_at
from bayesgrasp.objects import household
from bayesgrasp.observation.canonical_view import MapConfig, height_map, to_canonical_view
from bayesgrasp.observation.depth_files import read_depth
from bayesgrasp.seeding import generator

CANONICAL = canonical_camera()


@pytest.fixture(scope="module")
def objects():
    solids = [household.OBJECTS[name].build().mesh for name in sorted(household.OBJECTS)]
    return [Shape(solid.vertices, solid.faces) for solid in solids]


def viewpoint(rng):
    azimuth, elevation, distance = rng.uniform([-np.pi, 0.6, 0.7], [np.pi, 1.4, 1.0])
    level = np.array([np.cos(azimuth), np.sin(azimuth)]) * np.cos(elevation)
    focal = rng.uniform(450, 620)
    pose = look_at(distance * np.array([*level, np.sin(elevation)]), np.array([0.0, 0.0, 0.05]))
    return Camera(640, 480, focal, focal * rng.uniform(0.98, 1.02), rng.uniform(310, 330), rng.uniform(230, 250), pose)


def points(image, camera):
    """World points of the pixels that returned."""
    rows, columns = np.nonzero(image)
    return camera.unproject(np.stack([columns, rows], axis=1).astype(float), image[rows, columns].astype(float))


@pytest.mark.parametrize("view", range(20))
def test_a_scene_from_another_viewpoint_comes_back(objects, view):
    rng = generator(0, view)
    camera, scene, shape = viewpoint(rng), random_scenes(1, 1, rng), [objects[view % len(objects)]]
    seen = DepthSensor(shape, camera).render_clean(scene)[0]
    true = DepthSensor(shape).render_clean(scene)[0]
    image = to_canonical_view(seen, camera)
    shown = image > 0
    error = abs(image - true)[shown]
    assert shown.mean() > 0.35
    assert (error < 1e-3).mean() > 0.99
    assert (error > 0.01).mean() < 5e-3  # little is shown that the canonical camera would not see
    # What both cameras see is shown, but for the rims of objects and their hidden space.
    world = points(true, CANONICAL)
    pixels, depth = camera.project(world)
    u, v = np.rint(pixels).astype(int).T
    inside = (u > 1) & (u < 638) & (v > 1) & (v < 478)
    both = np.zeros(len(world), bool)
    both[inside] = abs(seen[v[inside], u[inside]] - depth[inside]) < 1e-3
    assert shown[true > 0][both].mean() > 0.94


def test_a_noisy_image_comes_back_with_its_holes(objects):
    rng = generator(1)
    camera, scene = viewpoint(rng), random_scenes(1, 1, rng)
    seen = DepthSensor(objects, camera).render(scene, None, rng)[0]
    true = DepthSensor(objects).render_clean(scene)[0]
    image = to_canonical_view(seen, camera)
    shown = image > 0
    assert (abs(image - true)[shown] < 0.01).mean() > 0.98


def test_the_canonical_camera_itself_changes_nothing(objects):
    image = DepthSensor(objects).render_clean(scenes(1))[0]
    again = to_canonical_view(image, CANONICAL)
    shown = again > 0
    np.testing.assert_allclose(again[shown], image[shown], rtol=1e-6)
    assert shown.mean() > 0.98


def test_the_table_is_completed_only_outside_the_view(objects):
    camera = CANONICAL.cropped(160, 120, 320, 240)
    image = DepthSensor(objects, camera).render_clean(scenes(1))[0]
    true = DepthSensor(objects).render_clean(scenes(1))[0]
    image[60:120, 60:120] = 0
    holes, completed = to_canonical_view(image, camera), to_canonical_view(image, camera, complete_table=True)
    assert (holes[:100] == 0).all()
    np.testing.assert_allclose(completed[:100], true[:100], rtol=1e-6)
    assert (completed[185:235, 225:275] == 0).all()


def test_height_map_shows_heights_and_what_is_hidden():
    block = plate(0.1, 0.06, 0.0, 0.08)
    sensor = DepthSensor([block])
    scene = scenes(1, (0.03, -0.05, 0.0))
    height, seen = height_map(sensor.render_clean(scene)[0], CANONICAL, MapConfig(side=0.4, cells=80))
    centres = (np.arange(80) + 0.5) * 0.005 - 0.2
    on_block = (abs(centres - 0.03) < 0.045)[:, None] & (abs(centres + 0.05) < 0.025)
    np.testing.assert_allclose(height[on_block], 0.08, atol=1e-5)
    assert seen[on_block].all()
    beside = (abs(centres - 0.03) < 0.045)[:, None] & (abs(centres - 0.05) < 0.05)
    np.testing.assert_allclose(height[beside], 0.0, atol=1e-5)
    behind = (abs(centres + 0.04) < 0.01)[:, None] & (abs(centres + 0.05) < 0.02)  # the camera is at +x
    assert not seen[behind].any()
    assert set(np.unique(seen)) == {0.0, 1.0}


@pytest.mark.parametrize("index", range(5))
def test_real_objects_are_where_they_were(real_depth_dir, index):
    camera = Camera.load(real_depth_dir / "camera.json")
    depth = read_depth(real_depth_dir / f"depth_{index}.npy")
    mask = np.array(Image.open(real_depth_dir / f"segmask_{index}.png")) > 0
    measured = points(np.where(mask, depth, 0), camera)
    view = points(to_canonical_view(depth, camera), CANONICAL)
    nearby = view[(abs(view[:, :2]) < 0.12).all(axis=1)]
    low = nearby[:, 2] < 0.004
    assert abs(np.median(nearby[low, 2])) < 0.002  # the table is the plane z = 0
    assert nearby[low, 2].std() < 0.002
    top = np.percentile(measured[:, 2], 99)
    assert np.percentile(nearby[nearby[:, 2] > 0.008, 2], 99) == pytest.approx(top, abs=0.002)
    height, seen = height_map(depth, camera, MapConfig(side=0.24, cells=96))
    tall = height > top / 2
    centres = (np.arange(96) + 0.5) * 0.0025 - 0.12
    place = np.array([centres[np.nonzero(tall)[axis]].mean() for axis in range(2)])
    tall_points = measured[measured[:, 2] > top / 2]
    cells = np.unique(np.floor(tall_points[:, :2] / 0.0025), axis=0)
    np.testing.assert_allclose(place, (cells.mean(axis=0) + 0.5) * 0.0025, atol=0.004)
    assert seen.mean() > 0.9


def test_what_does_not_fit_is_refused():
    with pytest.raises(DepthImageError, match="does not fit"):
        to_canonical_view(np.ones((10, 10)), CANONICAL)
    with pytest.raises(DepthImageError, match="camera_to_world"):
        to_canonical_view(np.ones((480, 640)), CANONICAL.with_pose(None))
    with pytest.raises(DepthImageError, match="finite"):
        height_map(np.full((480, 640), np.nan), CANONICAL)
    with pytest.raises(InvalidConfigurationError, match="cells"):
        MapConfig(cells=0)
