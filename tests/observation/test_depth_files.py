"""Depth files: every accepted form reads the same, everything else gets an error that says why."""

import numpy as np
import pytest
from PIL import Image

from bayesgrasp.errors import DepthImageError
from bayesgrasp.observation.depth_files import checked_depth, read_depth, write_depth_png
from bayesgrasp.seeding import generator


@pytest.fixture
def depth():
    image = generator(0).uniform(0.5, 1.2, (48, 64)).astype(np.float32)
    image[:5] = 0
    return image


def test_every_form_reads_the_same(tmp_path, depth):
    millimetres = np.rint(depth * 1000).astype(np.uint16)
    write_depth_png(tmp_path / "a.png", depth)
    np.save(tmp_path / "a.npy", depth)
    np.save(tmp_path / "mm.npy", millimetres)
    np.save(tmp_path / "float_mm.npy", depth.astype(np.float64) * 1000)
    np.save(tmp_path / "channel.npy", depth[..., None])
    np.save(tmp_path / "first.npy", depth[None])
    np.savez(tmp_path / "one.npz", depth)
    np.savez(tmp_path / "named.npz", depth=depth, mask=depth > 0)
    for path in sorted(tmp_path.iterdir()):
        image = read_depth(path)
        assert image.dtype == np.float32
        np.testing.assert_allclose(image, depth, atol=5.1e-4)
    np.testing.assert_array_equal(read_depth(tmp_path / "a.npy", unit="m"), depth)
    assert np.array_equal(np.array(Image.open(tmp_path / "a.png")), millimetres)


def test_nan_is_a_hole_only_if_asked(depth):
    depth[10:20] = np.nan
    depth[20:22] = np.inf
    with pytest.raises(DepthImageError, match="768 of 3072 pixels are NaN or infinite"):
        checked_depth(depth)
    assert (checked_depth(depth, nan_is_hole=True)[10:22] == 0).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d * 0, "all pixels are 0"),
        (lambda d: np.full_like(d, np.nan), "NaN"),
        (lambda d: d - 0.1, "negative"),
        (lambda d: d[0], "shape"),
        (lambda d: np.stack([d, d, d], axis=-1), "shape"),
        (lambda d: d[:8], "at least 16"),
        (lambda d: d.astype(complex), "integers or floating-point"),
        (lambda d: d > 0, "integers or floating-point"),
        (lambda d: (d * 100).astype(np.uint8), "8-bit"),
        (lambda d: d * 30, "cannot be told"),
        (lambda d: d * 1e6, "cannot be told"),
    ],
)
def test_what_is_no_depth_image_is_refused(depth, change, message):
    with pytest.raises(DepthImageError, match=message):
        checked_depth(change(depth))


def test_a_wrong_unit_is_refused(depth):
    with pytest.raises(DepthImageError, match="m would be plausible"):
        checked_depth(depth, unit="mm")
    with pytest.raises(DepthImageError, match="mm would be plausible"):
        checked_depth(depth * 1000, unit="m")
    with pytest.raises(DepthImageError, match="unknown unit"):
        checked_depth.__wrapped__(depth, unit="cm")


def test_files_that_cannot_be_read_are_named(tmp_path, depth):
    (tmp_path / "broken.png").write_bytes(b"no picture")
    (tmp_path / "broken.npy").write_bytes(b"no array")
    (tmp_path / "empty.npz").write_bytes(b"")
    (tmp_path / "depth.txt").write_text("0.7")
    Image.fromarray((depth * 100).astype(np.uint8)).save(tmp_path / "picture.png")
    np.savez(tmp_path / "two.npz", a=depth, b=depth)
    np.save(tmp_path / "objects.npy", np.array([{}]), allow_pickle=True)
    write_depth_png(tmp_path / "cut.png", depth)
    (tmp_path / "cut.png").write_bytes((tmp_path / "cut.png").read_bytes()[:1000])
    for path in [*sorted(tmp_path.iterdir()), tmp_path / "absent.png"]:
        with pytest.raises(DepthImageError, match=path.name):
            read_depth(path)


def test_depths_beyond_16_bits_are_not_written(tmp_path):
    with pytest.raises(DepthImageError, match=r"65\.535"):
        write_depth_png(tmp_path / "far.png", np.full((20, 20), 70.0, np.float32))
    assert not (tmp_path / "far.png").exists()
