"""Re-projection into the canonical camera: rendered scenes from 20 viewpoints, and real images."""

import numpy as np
import pytest
from box_scene import Box, box_depth_image
from PIL import Image
from pixels import cropped, seen_points
from scipy.spatial import KDTree
from sensor_scenes import Shape, random_scenes, scenes

from bayesgrasp.depth.sensor import DepthSensor
from bayesgrasp.errors import DepthImageError
from bayesgrasp.geometry.camera import Camera, canonical_camera, look_at
from bayesgrasp.objects import household
from bayesgrasp.observation.canonical_view import CanonicalView, to_canonical_view
from bayesgrasp.observation.depth_files import read_depth
from bayesgrasp.observation.preprocess import preprocess
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
    world = seen_points(CANONICAL, true)
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
    camera = cropped(CANONICAL, 160, 120, 320, 240)
    image = DepthSensor(objects, camera).render_clean(scenes(1))[0]
    true = DepthSensor(objects).render_clean(scenes(1))[0]
    image[60:120, 60:120] = 0
    holes, completed = to_canonical_view(image, camera), to_canonical_view(image, camera, complete_table=True)
    assert (holes[:100] == 0).all()
    np.testing.assert_allclose(completed[:100], true[:100], rtol=1e-6)
    assert (completed[185:235, 225:275] == 0).all()


@pytest.mark.parametrize("index", range(5))
def test_real_objects_are_where_they_were(real_depth_dir, index):
    camera = Camera.load(real_depth_dir / "camera.json")
    depth = read_depth(real_depth_dir / f"depth_{index}.npy")
    mask = np.array(Image.open(real_depth_dir / f"segmask_{index}.png")) > 0
    measured = seen_points(camera, np.where(mask, depth, 0))
    view = seen_points(CANONICAL, to_canonical_view(depth, camera))
    nearby = view[(abs(view[:, :2]) < 0.12).all(axis=1)]
    low = nearby[:, 2] < 0.004
    assert abs(np.median(nearby[low, 2])) < 0.002  # the table is the plane z = 0
    assert nearby[low, 2].std() < 0.002
    top = np.percentile(measured[:, 2], 99)
    assert np.percentile(nearby[nearby[:, 2] > 0.008, 2], 99) == pytest.approx(top, abs=0.002)
    tall = nearby[nearby[:, 2] > top / 2]
    assert np.median(KDTree(measured).query(tall)[0]) < 0.001
    # Masks leave out blurred rims, which are steep.
    assert np.percentile(KDTree(seen_points(camera, depth)).query(tall)[0], 99) < 0.005


def test_what_does_not_fit_is_refused():
    with pytest.raises(DepthImageError, match="does not fit"):
        to_canonical_view(np.ones((10, 10)), CANONICAL)
    with pytest.raises(DepthImageError, match="camera_to_world"):
        to_canonical_view(np.ones((480, 640)), CANONICAL.with_pose(None))
    with pytest.raises(DepthImageError, match="finite"):
        to_canonical_view(np.full((480, 640), np.nan), CANONICAL)


def test_the_canonical_camera_is_taken_as_it_is_and_another_one_is_reprojected() -> None:
    view = CanonicalView()
    boxes = (Box(x=0.02, y=0.01),)
    expected = preprocess(box_depth_image(CANONICAL, boxes))
    np.testing.assert_array_equal(view.of(box_depth_image(CANONICAL, boxes), CANONICAL), expected)
    pose = look_at(np.array([0.35, 0.05, 0.75]), np.array([0.0, 0.0, 0.05]))
    other = Camera(width=800, height=600, fx=700.0, fy=700.0, cx=399.5, cy=299.5, camera_to_world=pose)
    seen = view.of(box_depth_image(other, boxes), other)
    both = (seen > 0) & (expected > 0)
    assert both.mean() > 0.95 * (expected > 0).mean()
    assert np.percentile(np.abs(seen - expected)[both], 95) < 0.003
