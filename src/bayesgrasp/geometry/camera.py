"""A pinhole camera with its pose: projection, rays, resizing, and the camera file; the two cameras of the networks.

A point p of the camera frame (z forward, x right, y down, metres) is seen at the pixel

    u = fx p_x / p_z + cx,    v = fy p_y / p_z + cy,

where u counts columns and v counts rows, and integers are the centres of pixels: the centre of an image of W columns
is (W - 1) / 2. Depth is p_z, not the length of the ray. Lens distortion is not modelled.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from bayesgrasp.errors import DepthImageError, shown
from bayesgrasp.files import write_json
from bayesgrasp.geometry.camera_file import INTRINSICS, intrinsics_of, pose_of, read_camera_file

CANONICAL_POSITION = (0.40, 0.0, 0.70)
"""Of the canonical camera, metres, world frame."""
IMAGE_SHAPE = (160, 256)
"""Height and width of the network's image, which is also the one that data sets hold, pixels."""
ROTATION_TOLERANCE = 1e-3
"""A written rotation may be off by rounding; further off, it is a mistake."""
MOST_PIXELS = 50_000_000
"""Of an image; the largest depth cameras have two million."""
LONGEST = 1e6
"""Focal lengths and principal points beyond this many pixels are those of no camera."""
FARTHEST = 100.0
"""A camera further from the workspace than this does not look at it, metres."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Intrinsics, and the pose in the world frame where it is known.

    Attributes:
        width, height: Size of the image, pixels.
        fx, fy: Focal lengths, pixels.
        cx, cy: Principal point, pixels; (0, 0) is the centre of the first pixel.
        camera_to_world: Homogeneous transform, metres, read-only; None where the pose is unknown. A rotation off by
            rounding (up to `ROTATION_TOLERANCE`) is replaced by the closest one.

    Raises:
        DepthImageError: Singular intrinsics, a pose that is not rigid, or a camera below the table (z <= 0).
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    camera_to_world: Float[np.ndarray, "4 4"] | None = None

    def __post_init__(self) -> None:
        _check_intrinsics(self)
        if self.camera_to_world is not None:
            object.__setattr__(self, "camera_to_world", _checked_pose(self.camera_to_world))

    @classmethod
    def load(cls, path: str | Path) -> Camera:
        """Read a camera file: JSON with `intrinsics` and, optionally, `camera_to_world`; other keys are ignored.

        Raises:
            DepthImageError: The file is missing, is not JSON, or does not describe a camera.
        """
        content = read_camera_file(path)
        try:
            return cls.from_dict(content)
        except DepthImageError as error:
            raise DepthImageError(f"camera file {path}: {error}") from error

    @classmethod
    def from_dict(cls, content: Any) -> Camera:
        """The camera of a parsed camera file.

        Raises:
            DepthImageError: A key is missing, or a value is not a number of the right shape.
        """
        numbers = intrinsics_of(content)
        width, height = (int(numbers.pop(name)) for name in ("width", "height"))
        return cls(width=width, height=height, **numbers, camera_to_world=pose_of(content))

    def save(self, path: str | Path) -> None:
        """Write the camera file that `load` reads."""
        write_json(path, self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """The camera as the content of a camera file."""
        content: dict[str, Any] = {"intrinsics": {key: getattr(self, key) for key in INTRINSICS}}
        if self.camera_to_world is not None:
            content["camera_to_world"] = {
                "translation_m": self.camera_to_world[:3, 3].tolist(),
                "rotation": self.camera_to_world[:3, :3].tolist(),
            }
        return content

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """The intrinsic matrix K, pixels."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def pose(self) -> Float[np.ndarray, "4 4"]:
        """`camera_to_world`, for callers that cannot do without.

        Raises:
            DepthImageError: The pose is unknown.
        """
        if self.camera_to_world is None:
            raise DepthImageError("this camera has no pose: its file needs `camera_to_world`")
        return self.camera_to_world

    def with_pose(self, camera_to_world: Float[np.ndarray, "4 4"] | None) -> Camera:
        """The same intrinsics at another pose."""
        return replace(self, camera_to_world=camera_to_world)

    def matches(self, other: Camera) -> bool:
        """Whether both see the same up to rounding: image size, intrinsics, and pose, which both must have."""
        return (
            (self.width, self.height) == (other.width, other.height)
            and np.allclose(self.matrix, other.matrix, rtol=1e-6)
            and np.allclose(self.pose, other.pose, atol=1e-6)
        )

    def rays(self) -> Float[np.ndarray, "{self.height} {self.width} 3"]:
        """For every pixel, the point of the camera frame at depth 1: multiply by depth to unproject."""
        u = (np.arange(self.width) - self.cx) / self.fx
        v = (np.arange(self.height) - self.cy) / self.fy
        x, y = np.meshgrid(u, v)
        return np.stack([x, y, np.ones_like(x)], axis=-1)

    def camera_to_pixels(
        self, points: Float[np.ndarray, "*batch 3"]
    ) -> tuple[Float[np.ndarray, "*batch 2"], Float[np.ndarray, "*batch"]]:
        """Pixels (u, v) and depth (m) of points in the camera frame; pixels are NaN at depth <= 0 (behind)."""
        depth = points[..., 2]
        safe = np.where(depth > 0, depth, np.nan)
        pixels = np.stack(
            [self.fx * points[..., 0] / safe + self.cx, self.fy * points[..., 1] / safe + self.cy], axis=-1
        )
        return pixels, depth

    def project(
        self, points: Float[np.ndarray, "*batch 3"]
    ) -> tuple[Float[np.ndarray, "*batch 2"], Float[np.ndarray, "*batch"]]:
        """Pixels (u, v) and depth (m) of points in the world frame; pixels are NaN behind the camera."""
        rotation, translation = self.pose[:3, :3], self.pose[:3, 3]
        return self.camera_to_pixels((points - translation) @ rotation)

    def resized(self, width: int, height: int) -> Camera:
        """The camera of the image stretched to another size (the outer edges of the image stay where they are)."""
        sx, sy = width / self.width, height / self.height
        return replace(
            self,
            width=width,
            height=height,
            fx=self.fx * sx,
            fy=self.fy * sy,
            cx=(self.cx + 0.5) * sx - 0.5,
            cy=(self.cy + 0.5) * sy - 0.5,
        )


def look_at(
    eye: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"], up: Float[np.ndarray, "3"] | None = None
) -> Float[np.ndarray, "4 4"]:
    """`camera_to_world` of a camera at `eye` that looks at `target` with a horizontal image x axis.

    Args:
        eye: Position of the camera, metres.
        target: A point on the optical axis, metres.
        up: The direction that appears upwards in the image; world z unless given.

    Raises:
        DepthImageError: `eye` and `target` coincide, or the view is along `up`.
    """
    up = np.array([0.0, 0.0, 1.0]) if up is None else up
    forward = np.asarray(target, dtype=np.float64) - eye
    right = np.cross(forward, up)
    if np.linalg.norm(right) <= 1e-9 * np.linalg.norm(up) * max(1.0, float(np.linalg.norm(forward))):
        raise DepthImageError("look_at needs a target apart from the eye, and an `up` that is not the line of sight")
    forward, right = forward / np.linalg.norm(forward), right / np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=-1)
    pose[:3, 3] = eye
    return pose


def canonical_camera() -> Camera:
    """The Kinect v1 of the benchmark scene; the paper leaves its pose open.

    It stands 0.76 m from the point it looks at, within the 0.7 to 0.95 m that depths in [0.45, 1] m ask for.
    """
    pose = look_at(np.array(CANONICAL_POSITION), np.array([0.0, 0.0, 0.05]))
    return Camera(width=640, height=480, fx=580.0, fy=580.0, cx=319.5, cy=239.5, camera_to_world=pose)


def network_camera() -> Camera:
    """The camera of the network's image: the canonical one, its image stretched to `IMAGE_SHAPE`."""
    height, width = IMAGE_SHAPE
    return canonical_camera().resized(width, height)


def _check_intrinsics(camera: Camera) -> None:
    values = np.array([camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy], dtype=np.float64)
    if not np.isfinite(values).all():
        found = dict(zip(INTRINSICS, values.tolist(), strict=True))
        raise DepthImageError(f"camera intrinsics must be finite numbers, got {found}")
    if camera.width < 1 or camera.height < 1:
        raise DepthImageError(f"a camera needs at least one pixel each way, got {values[0]:g} x {values[1]:g}")
    if camera.width * camera.height > MOST_PIXELS:
        raise DepthImageError(
            f"an image has at most {MOST_PIXELS:,} pixels, the intrinsics are for {values[0]:g} x {values[1]:g}"
        )
    if camera.fx <= 0 or camera.fy <= 0:
        raise DepthImageError(
            f"singular intrinsics: focal lengths must be positive pixels, got fx={camera.fx}, fy={camera.fy}"
        )
    if np.abs(values[2:]).max() > LONGEST:
        raise DepthImageError(f"fx, fy, cx and cy are at most {LONGEST:g} pixels, got {shown(values[2:].tolist())}")


def _checked_pose(camera_to_world: np.ndarray) -> np.ndarray:
    pose = np.array(camera_to_world, dtype=np.float64)
    if pose.shape != (4, 4) or not np.isfinite(pose).all() or not np.allclose(pose[3], [0, 0, 0, 1], atol=1e-9):
        raise DepthImageError("camera_to_world must be finite and 4 x 4, with the last row (0, 0, 0, 1)")
    closest = _closest_rotation(pose[:3, :3])
    error = np.abs(closest - pose[:3, :3]).max()
    if np.linalg.det(closest) < 0 or error > ROTATION_TOLERANCE:
        raise DepthImageError(
            "the rotation of camera_to_world is not a rotation: its columns must be the camera's x, y and z axes in "
            "the world frame, of unit length, perpendicular and right-handed"
        )
    if pose[2, 3] <= 0:
        raise DepthImageError(
            f"the camera is at z = {pose[2, 3]:.3f} m, not above the table: camera_to_world must map the camera frame "
            "into a world with z up and its origin on the table top"
        )
    if np.abs(pose[:3, 3]).max() > FARTHEST:
        raise DepthImageError(
            f"the camera is at {shown(pose[:3, 3].tolist())}, more than {FARTHEST:g} m from the origin of the world "
            "along an axis: translations are metres, and the origin is on the table top"
        )
    if error > 1e-9:  # leave an exact rotation alone, so that a saved camera is read back bit for bit
        pose[:3, :3] = closest
    pose.flags.writeable = False
    return pose


def _closest_rotation(matrix: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """The orthogonal matrix closest to a matrix; some other one for entries that no rotation has, which may be huge."""
    left, _, right = np.linalg.svd(matrix.clip(-2.0, 2.0))
    closest: np.ndarray = left @ right
    return closest
