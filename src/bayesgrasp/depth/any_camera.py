"""Network images of cameras anywhere: the sensor's image, brought into the canonical view by what is stated of it.

The camera that takes the image is the actual one, the camera that it is drawn again from is the stated one, as it is
with a user's image. Images of the canonical camera need no drawing and only the pixels that the networks see.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32

from bayesgrasp.depth.kinect import KinectConfig
from bayesgrasp.depth.sensor import DepthSensor, Visible
from bayesgrasp.depth.stereo import StereoConfig
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.geometry.camera_nuisances import disturbed_camera
from bayesgrasp.observation.canonical_view import CanonicalView
from bayesgrasp.types import CameraNuisances, Scenes, StatedCameras


class AnySensor:
    """Takes network images with structured-light and stereo cameras.

    Args:
        objects: The ordered set that `Scenes.object_index` refers to.
        kinect: Constants of the structured-light cameras.
        stereo: Constants of the stereo cameras.

    Raises:
        AssetError: An object's mesh cannot be seen.
    """

    def __init__(
        self, objects: Sequence[Visible], kinect: KinectConfig | None = None, stereo: StereoConfig | None = None
    ) -> None:
        self.kinect = DepthSensor(objects, config=kinect)
        self.stereo = self.kinect.of_make(StereoConfig() if stereo is None else stereo)
        self._view, self._known = CanonicalView(), canonical_camera()

    def images(
        self, scenes: Scenes, cameras: CameraNuisances, rng: np.random.Generator
    ) -> Float32[np.ndarray, "n 160 256"]:
        """Network inputs, in {0} u [0.45, 1] m.

        Args:
            scenes: n scenes.
            cameras: n cameras; without a statement they are taken for the canonical one.
            rng: Of the noise.
        """
        if not isinstance(cameras, StatedCameras):
            return self.kinect.images(scenes, cameras, rng)
        each = [self._image(scenes[i : i + 1], cameras[i : i + 1], rng) for i in range(len(scenes))]
        return np.concatenate([np.zeros((0, *self._view.shape), np.float32), *each])

    def _image(self, scene: Scenes, camera: StatedCameras, rng: np.random.Generator) -> Float32[np.ndarray, "1 h w"]:
        sensor, stated = self.stereo if camera.stereo[0] else self.kinect, stated_camera(camera, 0)
        if stated.matches(self._known):
            return sensor.images(scene, camera.actual, rng)
        step = self._view.step(stated)
        depth = sensor.thinned(scene, camera.actual, rng, step)[0]
        return self._view.of_thinned(depth, stated, step)[None]


def stated_camera(cameras: StatedCameras, index: int) -> Camera:
    """What is said of a camera: the canonical one as row `index` displaces it."""
    return disturbed_camera(canonical_camera(), cameras.stated, index)
