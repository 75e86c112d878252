"""The render command: files that read back, reproducible, and one clear error for wrong input."""

import numpy as np
import pytest
from PIL import Image
from pixels import seen_points

from bayesgrasp.cli.main import main
from bayesgrasp.geometry.camera import Camera, canonical_camera
from bayesgrasp.observation.depth_files import read_depth

BALL = ("--object", "household_ball")


def render(out, *options):
    main(["render", "--out", str(out), *options])


def fails(capsys, out, *options):
    with pytest.raises(SystemExit) as exit_info:
        render(out, *options)
    assert exit_info.value.code == 2
    assert not out.exists()
    return capsys.readouterr().err


def test_files_read_back_and_show_the_object(tmp_path):
    render(tmp_path / "a", *BALL, "--pose", "0.02", "-0.03", "0.5", "--scale", "1.1", "--seed", "3")
    names = {path.name for path in (tmp_path / "a").iterdir()}
    assert names == {"depth.png", "depth.npy", "clean.png", "clean.npy", "picture.png", "camera.json"}
    noisy, clean = (np.load(tmp_path / "a" / f"{name}.npy") for name in ("depth", "clean"))
    np.testing.assert_allclose(read_depth(tmp_path / "a" / "depth.png"), noisy, atol=5.1e-4)
    np.testing.assert_allclose(read_depth(tmp_path / "a" / "clean.png"), clean, atol=5.1e-4)
    assert noisy.dtype == np.float32
    assert (noisy == 0).any()
    camera = Camera.load(tmp_path / "a" / "camera.json")
    np.testing.assert_array_equal(camera.pose, canonical_camera().pose)
    world = seen_points(camera, clean)
    np.testing.assert_allclose(world[world[:, 2] > 0.06, :2].mean(0), [0.02, -0.03], atol=0.01)
    assert np.asarray(Image.open(tmp_path / "a" / "picture.png")).std() > 10


def test_the_seed_decides_the_noise_and_the_disturbance(tmp_path):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        render(tmp_path / name, *BALL, "--seed", str(seed), "--disturb")
    first, same, other = (np.load(tmp_path / name / "depth.npy") for name in "abc")
    np.testing.assert_array_equal(first, same)
    assert (first != other).mean() > 0.3
    poses = [Camera.load(tmp_path / name / "camera.json").pose for name in "ac"]
    assert 0 < abs(poses[0] - poses[1]).max() < 0.1


def test_another_camera_is_used(tmp_path):
    small = canonical_camera().resized(160, 120)
    small.save(tmp_path / "camera.json")
    render(tmp_path / "a", *BALL, "--camera", str(tmp_path / "camera.json"))
    assert np.load(tmp_path / "a" / "depth.npy").shape == (120, 160)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((*BALL, "--pose", "2", "0", "0"), "--pose"),
        ((*BALL, "--pose", "nan", "0", "0"), "--pose"),
        ((*BALL, "--scale", "0"), "--scale"),
        (("--object", "teapot"), "teapot"),
        ((), "--object"),
        ((*BALL, "--camera", "absent.json"), "absent.json"),
    ],
)
def test_wrong_input_gets_one_clear_error_and_no_files(tmp_path, capsys, options, message):
    assert message in fails(capsys, tmp_path / "out", *options)
