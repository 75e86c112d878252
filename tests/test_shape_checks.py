"""The shape checks of `conftest.py` are really on: an annotation that is not true fails a test."""

import jaxtyping
import numpy as np
import pytest

from bayesgrasp.robot.arm import ur5


def test_a_wrong_shape_is_refused() -> None:
    with pytest.raises(jaxtyping.TypeCheckError):
        ur5().forward_kinematics(np.zeros(5))


def test_a_wrong_precision_is_refused() -> None:
    with pytest.raises(jaxtyping.TypeCheckError):
        ur5().forward_kinematics(np.zeros(6, dtype=np.float32))


def test_a_wrong_type_is_refused() -> None:
    with pytest.raises(jaxtyping.TypeCheckError):
        ur5("here")  # type: ignore[arg-type]
