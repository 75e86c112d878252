"""Images of cameras anywhere: the law, the statement, and that what stands on the table is seen from every side."""

import numpy as np
import pytest
from sensor_scenes import Shape

from bayesgrasp.depth.any_camera import AnySensor, stated_camera
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import canonical_camera, network_camera
from bayesgrasp.objects import household
from bayesgrasp.observation.canonical_view import CanonicalView
from bayesgrasp.observation.surface import SurfaceReader
from bayesgrasp.observation.user_camera import aligned_workspace
from bayesgrasp.prior.cameras import AnyCamera, camera_law, cameras_at
from bayesgrasp.prior.nuisance import CameraPrior
from bayesgrasp.seeding import generator
from bayesgrasp.types import Scenes, StatedCameras

NAMES = sorted(household.OBJECTS)


@pytest.fixture(scope="module")
def sensor() -> AnySensor:
    solids = [household.OBJECTS[name].build().mesh for name in NAMES]
    return AnySensor([Shape(solid.vertices, solid.faces) for solid in solids])


def test_cameras_stand_where_the_law_says() -> None:
    cameras = AnyCamera().sample(2000, generator(0))
    every = [stated_camera(cameras, i) for i in range(2000)]
    canonical = np.array([camera.matches(canonical_camera()) for camera in every])
    assert 0.2 < canonical.mean() < 0.3
    assert 0.45 < cameras.stereo.mean() < 0.55
    others = [camera for camera, known in zip(every, canonical, strict=True) if not known]
    forward = np.array([camera.pose[:3, 2] for camera in others])
    elevation = np.degrees(np.arcsin(-forward[:, 2]))
    assert elevation.min() > 9.9
    assert 88 < elevation.max() <= 90.01
    views = np.degrees(2 * np.arctan(320 / np.array([camera.fx for camera in others])))
    assert 55 < views.min() < 56
    assert 79 < views.max() < 80
    # They look at the workspace, and none needs the world turned.
    eyes = np.array([camera.pose[:3, 3] for camera in others])
    miss = np.linalg.norm(np.cross(np.array([0, 0, 0.05]) - eyes, forward), axis=1)
    assert miss.max() < 0.1
    near = np.array([abs(np.arctan2(*aligned_workspace(c.pose, 0.0)[[1, 0], 0])) for c in others])
    assert np.percentile(near, 95) < 0.45


def test_the_statement_is_off_by_the_errors_of_the_prior() -> None:
    cameras = AnyCamera(canonical_share=1.0).sample(500, generator(1))
    known = CameraPrior().sample(500, generator(2))
    for name in ("position_offset", "rotation_vector", "field_of_view_factor"):
        assert getattr(cameras, name).std(0) == pytest.approx(getattr(known, name).std(0), rel=0.15, abs=1e-6)
    assert isinstance(cameras[:3], StatedCameras)
    exact = AnyCamera(errors=CameraPrior(relative_error=0.0, rotation_deviation=(0.0, 0.0, 0.0)))
    some = exact.sample(50, generator(3))
    np.testing.assert_allclose(some.position_offset, some.stated_position_offset, atol=1e-6)
    np.testing.assert_allclose(some.rotation_vector, some.stated_rotation_vector, atol=1e-5)


def test_the_canonical_camera_among_them_gives_its_own_images(sensor: AnySensor) -> None:
    scene = Scenes(np.array([3], np.int32), np.ones(1, np.float32), np.zeros((1, 3), np.float32))
    cameras = AnyCamera(canonical_share=1.0, stereo_share=0.0).sample(1, generator(4))
    image = sensor.images(scene, cameras, generator(5))
    np.testing.assert_array_equal(image, sensor.kinect.images(scene, cameras.actual, generator(5)))
    plain = sensor.images(scene, cameras.actual, generator(5))
    np.testing.assert_array_equal(image, plain)


def test_an_image_is_the_one_that_a_user_would_hand_in(sensor: AnySensor) -> None:
    scene = Scenes(np.array([5], np.int32), np.ones(1, np.float32), np.zeros((1, 3), np.float32))
    view, steps = CanonicalView(), set()
    for number in range(4):
        cameras = AnyCamera(canonical_share=0.0).sample(1, generator(8, number))
        camera = stated_camera(cameras, 0)
        device = sensor.stereo if cameras.stereo[0] else sensor.kinect
        whole = device.render(scene, cameras.actual, generator(9))[0]
        np.testing.assert_array_equal(sensor.images(scene, cameras, generator(9))[0], view.of(whole, camera))
        steps.add(view.step(camera))
    assert len(steps) > 1


@pytest.mark.parametrize("stereo", [False, True])
@pytest.mark.parametrize("degrees", [90, 75, 20, 10])
def test_something_is_on_the_table_whatever_the_view(sensor: AnySensor, degrees: float, stereo: bool) -> None:
    n = len(NAMES)
    law = cameras_at(np.radians(degrees), azimuth=(-0.3, 0.3))
    cameras = law.sample(n, generator(6))
    cameras = StatedCameras(**{**cameras.columns(), "stereo": np.full(n, stereo)})
    pose = np.tile(np.array([0.01, 0.02, 0.5], np.float32), (n, 1))
    scenes = Scenes(np.arange(n, dtype=np.int32), np.ones(n, np.float32), pose)
    reader = SurfaceReader(network_camera())
    surfaces = [reader.read(image) for image in sensor.images(scenes, cameras, generator(7))]
    problems = {name: s.problem() for name, s in zip(NAMES, surfaces, strict=True) if s.problem() is not None}
    assert not problems
    off = [np.hypot(*(surface.center - [0.01, 0.02])) for surface in surfaces]
    assert np.median(off) < 0.03


def test_what_is_no_law_of_cameras_is_refused() -> None:
    for wrong in ({"elevation": (0.0, 1.0)}, {"stereo_share": 1.1}, {"distance": (1.0, 0.5)}, {"roll": -1.0}):
        with pytest.raises(InvalidConfigurationError):
            AnyCamera(**wrong)
    assert camera_law("canonical") == CameraPrior()
