"""Effective sample sizes of the successes in scenes."""

import numpy as np
import pytest

from bayesgrasp.data.effective import effective_size, effective_successes
from bayesgrasp.types import Outcome


def scenes(weight: list[list[float]]) -> dict[str, np.ndarray]:
    """Two draws with two scenes each; both scenes of a draw hold the same three attempts, the third a failure."""
    return {
        "draw": np.array([0, 0, 1, 1]),
        "object_index": np.array([0, 0, 1, 1]),
        "hand_outcome": np.tile(np.uint8([Outcome.SUCCESS, Outcome.SUCCESS, Outcome.DROPPED]), (4, 1)),
        "hand_source": np.tile(np.int32([0, 1, 2]), (4, 1)),
        "hand_weight": np.array(weight, np.float32),
        "hand_selection_weight": np.ones((4, 3), np.float32),
    }


def test_equal_weights_count_fully_and_failures_not_at_all() -> None:
    found = effective_successes(scenes([[0.1, 0.1, 9.0]] * 4))
    assert (found.hands, found.attempts) == (8, 4)
    assert found.by_weight == pytest.approx(8)
    assert found.attempts_by_weight == pytest.approx(4)
    assert found.attempts_by_selection == pytest.approx(4)


def test_one_heavy_hand_outweighs_the_others() -> None:
    found = effective_successes(scenes([[1, 0, 0], [1, 0, 0], [2, 2, 0], [0, 0, 0]]))
    assert found.by_weight == pytest.approx(6**2 / 10)
    assert found.attempts_by_weight == pytest.approx(6**2 / 12)


def test_objects_are_counted_apart() -> None:
    columns = scenes([[1, 1, 0], [1, 1, 0], [1, 0, 0], [0, 0, 0]])
    assert effective_successes(columns, 0).by_weight == pytest.approx(4)
    assert effective_successes(columns, 1).attempts_by_weight == pytest.approx(1)
    assert effective_successes(columns, 2).by_weight == 0


def test_no_weight_is_worth_nothing() -> None:
    assert effective_size(np.zeros(3)) == 0
    assert effective_size(np.zeros(0)) == 0
