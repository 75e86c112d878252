"""Meeting zonotopes against linear programming, and where boxes are aligned."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from bayesgrasp.geometry.zonotope import meet


def meet_by_program(center: np.ndarray, generators: np.ndarray, other: np.ndarray, others: np.ndarray) -> bool:
    """Whether factors in [-1, 1] bring both to one point."""
    both = np.concatenate([generators, -others]).T
    return bool(linprog(np.zeros(both.shape[1]), A_eq=both, b_eq=other - center, bounds=(-1, 1)).success)


def half_axes(rng: np.random.Generator, aligned: bool) -> np.ndarray:
    axes = np.diag(rng.uniform(0.02, 0.3, 3))
    return axes if aligned else axes @ Rotation.random(random_state=rng).as_matrix()


@pytest.mark.parametrize("aligned", [False, True])
def test_they_meet_where_a_linear_program_finds_a_common_point(aligned) -> None:
    rng = np.random.default_rng(0)
    other, others = np.array([0.1, -0.2, 0.3]), half_axes(rng, True)
    swept = [np.concatenate([half_axes(rng, aligned), rng.uniform(-0.3, 0.3, (1, 3))]) for _ in range(300)]
    centers = other + rng.uniform(-0.45, 0.45, (300, 3))
    found = meet(centers, np.stack(swept), other, others)
    expected = [meet_by_program(center, each, other, others) for center, each in zip(centers, swept, strict=True)]
    assert 60 < found.sum() < 240
    assert found.tolist() == expected


def test_parallel_boxes_meet_until_their_faces_part() -> None:
    """Every cross product of parallel generators is zero or noise."""
    cube, turned = np.eye(3), Rotation.from_euler("z", 90, degrees=True).as_matrix()
    gaps = np.array([1.9, 2.0 - 1e-9, 2.0 + 1e-9, 2.1])
    centers = gaps[:, None] * np.array([0.0, 0.0, 1.0])
    for axes in (cube, turned):
        assert meet(centers, np.tile(axes, (4, 1, 1)), np.zeros(3), cube).tolist() == [True, True, False, False]
