"""The pinhole camera: round trips, conventions, resizing, and every bad camera file."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from pixels import in_camera, in_world

from bayesgrasp.errors import DepthImageError
from bayesgrasp.geometry.camera import Camera, canonical_camera, look_at


def test_project_inverts_unproject() -> None:
    camera = canonical_camera()
    rng = np.random.default_rng(0)
    pixels = rng.uniform([0, 0], [639, 479], size=(5, 7, 2))
    depth = rng.uniform(0.45, 1.0, size=(5, 7))
    again, depth_again = camera.project(in_world(camera, pixels, depth))
    np.testing.assert_allclose(again, pixels, atol=1e-9)
    np.testing.assert_allclose(depth_again, depth, atol=1e-12)


def test_rays_unproject_every_pixel() -> None:
    camera = canonical_camera().resized(64, 48)
    rows, columns = np.mgrid[:48, :64]
    pixels = np.stack([columns, rows], axis=-1).astype(np.float64)
    depth = np.full((48, 64), 0.7)
    np.testing.assert_allclose(camera.rays() * depth[..., None], in_camera(camera, pixels, depth), atol=1e-12)


def test_axes_follow_the_convention() -> None:
    camera = canonical_camera()
    centre = np.array([0.0, 0.0, 0.05])
    middle, depth = camera.project(centre)
    np.testing.assert_allclose(middle, [319.5, 239.5], atol=1e-9)
    np.testing.assert_allclose(depth, np.linalg.norm([0.40, 0.65]))
    above, _ = camera.project(np.array([0.0, 0.0, 0.15]))
    left, _ = camera.project(np.array([0.0, -0.1, 0.05]))
    assert above[1] < middle[1]
    # The camera faces -x with z up, so its right is world +y.
    assert left[0] < middle[0]
    np.testing.assert_allclose(left[1], middle[1], atol=1e-9)


def test_points_behind_have_no_pixel() -> None:
    pixels, depth = canonical_camera().camera_to_pixels(np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]))
    assert np.isnan(pixels).all()
    assert (depth <= 0).all()


def test_resizing_keeps_the_outer_edges() -> None:
    camera = canonical_camera()
    points = in_world(camera, np.array([[-0.5, -0.5], [639.5, 479.5]]), np.full(2, 0.8))
    small, _ = camera.resized(256, 160).project(points)
    np.testing.assert_allclose(small, [[-0.5, -0.5], [255.5, 159.5]], atol=1e-9)


def test_file_round_trip(tmp_path: Path) -> None:
    camera = canonical_camera()
    camera.save(tmp_path / "camera.json")
    again = Camera.load(tmp_path / "camera.json")
    assert again.to_dict() == camera.to_dict()
    bare = camera.with_pose(None)
    bare.save(tmp_path / "bare.json")
    assert Camera.load(tmp_path / "bare.json").camera_to_world is None
    with pytest.raises(DepthImageError, match="no pose"):
        _ = bare.pose


def test_published_camera_file_is_read_and_made_orthonormal(real_depth_dir: Path) -> None:
    camera = Camera.load(real_depth_dir / "camera.json")
    rotation = camera.pose[:3, :3]
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
    assert rotation[2, 2] < -0.9  # looks down


def content(**changes: object) -> dict[str, object]:
    """A valid file with some keys replaced; dots address inner keys, None removes."""
    result: dict[str, dict[str, object]] = json.loads(json.dumps(canonical_camera().to_dict()))
    for name, value in changes.items():
        outer, _, inner = name.partition("__")
        section = result[outer] if inner else result
        if value is None:
            del section[inner or outer]
        else:
            section[inner or outer] = value  # type: ignore[assignment]
    return result  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"intrinsics": None}, "missing: width, height, fx"),
        ({"intrinsics__fx": None}, "missing: fx"),
        ({"intrinsics__fx": 0.0}, "singular intrinsics"),
        ({"intrinsics__fy": float("nan")}, r"intrinsics\.fy must be a number"),
        ({"intrinsics__width": 640.5}, "whole number"),
        ({"intrinsics__height": 0}, "at least one pixel"),
        ({"intrinsics__cx": "left"}, r"intrinsics\.cx must be a number"),
        ({"camera_to_world__rotation": None}, "missing: rotation"),
        ({"camera_to_world__rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "not a rotation"),
        ({"camera_to_world__rotation": [[2, 0, 0], [0, 2, 0], [0, 0, 2]]}, "not a rotation"),
        ({"camera_to_world__rotation": [1, 2, 3]}, "shape"),
        ({"camera_to_world__translation_m": [0.0, 0.0, -0.7]}, "not above the table"),
        ({"camera_to_world__translation_m": [0.0, 0.7]}, "shape"),
        ({"camera_to_world": [1.0]}, "camera_to_world"),
    ],
)
def test_bad_content_is_refused_by_name(changes: dict[str, object], message: str) -> None:
    with pytest.raises(DepthImageError, match=message):
        Camera.from_dict(content(**changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"intrinsics__fx": "580"}, r"intrinsics\.fx must be a number, got '580'"),
        ({"intrinsics__fx": True}, r"intrinsics\.fx must be a number, got True"),
        ({"intrinsics__fx": [580.0]}, r"intrinsics\.fx must be a number"),
        ({"intrinsics__fx": 10**400}, r"intrinsics\.fx must be a number, finite"),
        ({"intrinsics__fx": 1e300}, r"at most 1e\+06 pixels"),
        ({"intrinsics__cy": -1e9}, r"at most 1e\+06 pixels"),
        ({"intrinsics__width": 1e30}, "at most 50,000,000 pixels"),
        ({"intrinsics__width": 1e300, "intrinsics__height": 1e300}, "at most 50,000,000 pixels"),
        ({"intrinsics__width": 10_000, "intrinsics__height": 10_000}, "at most 50,000,000 pixels"),
        ({"intrinsics__width": "x" * 10**6}, r"intrinsics\.width must be a number"),
        ({"camera_to_world__translation_m": ["0.4", "0.0", "0.7"]}, "translation_m must be an array"),
        ({"camera_to_world__translation_m": [0.4, False, 0.7]}, "translation_m must be an array"),
        ({"camera_to_world__translation_m": [0.4, 0.0, 700.0]}, "more than 100 m from the origin"),
        ({"camera_to_world__rotation": [[1e308] * 3] * 3}, "not a rotation"),
        ({"camera_to_world__rotation": [[1, 0, 0], [0, 1, 0], [0, 0]]}, "shape"),
        ({"camera_to_world__rotation": [[[]] * 3] * 3}, "shape"),
        ({"camera_to_world": False}, "camera_to_world"),
    ],
)
def test_what_no_camera_has_is_refused_in_one_short_line(changes: dict[str, object], message: str) -> None:
    with pytest.raises(DepthImageError, match=message) as refused:
        Camera.from_dict(content(**changes))
    assert len(str(refused.value)) < 300
    assert "\n" not in str(refused.value)


def test_files_that_are_endless_huge_or_deep_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.json")
    (tmp_path / "huge.json").write_text(json.dumps(content(note="x" * 2**20)))
    (tmp_path / "deep.json").write_text('{"intrinsics": ' + "[" * 100_000 + "]" * 100_000 + "}")
    (tmp_path / "twice.json").write_text(json.dumps(content())[:-1] + ', "intrinsics": {}}')
    messages = {"pipe": "a pipe", "huge": "at most 1 MiB", "deep": "nested deeper", "twice": "stands twice"}
    for name, message in messages.items():
        with pytest.raises(DepthImageError, match=rf"camera file: .*{name}\.json.*{message}") as refused:
            Camera.load(tmp_path / f"{name}.json")
        assert len(str(refused.value)) < 400
    with pytest.raises(DepthImageError, match="a device"):
        Camera.load("/dev/zero")


def test_numbers_of_numpy_are_numbers() -> None:
    numbers = {name: np.float32(value) for name, value in canonical_camera().to_dict()["intrinsics"].items()}
    pose = {"translation_m": np.array([0.4, 0.0, 0.7]), "rotation": np.diag([1.0, -1.0, -1.0])}
    assert Camera.from_dict({"intrinsics": numbers, "camera_to_world": pose}).width == 640


def test_unreadable_files_are_refused_with_their_path(tmp_path: Path) -> None:
    with pytest.raises(DepthImageError, match=r"missing\.json"):
        Camera.load(tmp_path / "missing.json")
    broken = tmp_path / "broken.json"
    broken.write_text("{")
    with pytest.raises(DepthImageError, match="not JSON"):
        Camera.load(broken)
    broken.write_text("[]")
    with pytest.raises(DepthImageError, match="intrinsics"):
        Camera.load(broken)


def test_look_at_refuses_a_degenerate_view() -> None:
    eye = np.array([0.0, 0.0, 1.0])
    with pytest.raises(DepthImageError, match="line of sight"):
        look_at(eye, np.zeros(3))
    with pytest.raises(DepthImageError, match="apart from the eye"):
        look_at(eye, eye)
    pose = look_at(eye, np.zeros(3), up=np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(np.linalg.det(pose[:3, :3]), 1.0)
