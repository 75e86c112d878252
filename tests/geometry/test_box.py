"""Boxes: their faces are inside, however they are rounded."""

import numpy as np
import pytest
import torch

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.box import Box


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_box_never_rounds_outwards(dtype) -> None:
    box = Box((-0.15, -0.15, 0.12), (0.15, 0.15, 0.34))
    low, high = box.corners(torch.zeros(1, dtype=dtype))
    assert (low.double().numpy() >= np.array(box.low)).all()
    assert (high.double().numpy() <= np.array(box.high)).all()
    far = torch.tensor([[-9.0, 9.0, 9.0]], dtype=dtype)
    assert box.contains(box.clip(far)).all()
    assert not box.contains(far).any()


def test_what_is_no_box_is_refused() -> None:
    with pytest.raises(InvalidConfigurationError, match="low < high"):
        Box((0.0, 0.0, 0.0), (1.0, 0.0, 1.0))
    with pytest.raises(InvalidConfigurationError, match="finite"):
        Box((0.0, 0.0, 0.0), (1.0, 1.0, float("inf")))
