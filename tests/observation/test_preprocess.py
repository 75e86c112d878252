"""Preprocessing: range, nearest pixels, and no averaging."""

import numpy as np
import pytest

from bayesgrasp.errors import DepthImageError
from bayesgrasp.observation.preprocess import preprocess, sampled_columns, sampled_rows
from bayesgrasp.seeding import generator


def test_every_output_pixel_is_the_nearest_input_pixel():
    rows, columns = sampled_rows(), sampled_columns()
    assert abs((rows + 0.5) / 480 - (np.arange(160) + 0.5) / 160).max() <= 0.5 / 480
    assert abs((columns + 0.5) / 640 - (np.arange(256) + 0.5) / 256).max() <= 0.5 / 640
    depth = generator(0).uniform(0.45, 1.0, (2, 480, 640))
    np.testing.assert_array_equal(preprocess(depth), depth[:, rows[:, None], columns].astype(np.float32))


def test_depths_out_of_range_and_holes_become_holes():
    depth = np.full((480, 640), 0.7)
    depth[:120], depth[120:240], depth[240:360] = 0.449, 1.001, np.nan
    image = preprocess(depth)
    assert (image[:120] == 0).all()
    assert (image[120:] == np.float32(0.7)).all()
    assert image.dtype == np.float32


def test_a_hole_is_never_mixed_with_depth():
    depth = np.where(generator(1).random((480, 640)) < 0.5, 0.0, 0.8)
    assert set(np.unique(preprocess(depth))) == {0.0, np.float32(0.8)}


def test_another_shape_is_refused():
    with pytest.raises(DepthImageError, match="to_canonical_view"):
        preprocess(np.zeros((240, 320)))
