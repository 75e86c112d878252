"""Hands become rows and come back: the same hand, in order, within a rounding of float32."""

import numpy as np
import pytest
import torch

from bayesgrasp.geometry import so3
from bayesgrasp.geometry.hand_arrays import attempts_of, hands_from, hands_of
from bayesgrasp.types import Attempts, Hands, Nuisances, Scenes

SHAPE = (3, 4)


def some_hands(dtype: torch.dtype = torch.float32) -> Hands:
    rng = np.random.default_rng(0)
    position = torch.from_numpy(rng.uniform(-0.2, 0.3, (*SHAPE, 3))).to(dtype)
    rotation = so3.random_rotation(12, rng, torch.float64).to(dtype).reshape(*SHAPE, 3, 3)
    return Hands(position, rotation, torch.from_numpy(rng.integers(3, size=SHAPE)))


def rows_of(hands: Hands) -> Attempts:
    numbers = np.arange(12, dtype=np.float32)
    scenes = Scenes(np.arange(12, dtype=np.int32), 1 + numbers, np.stack([numbers] * 3, axis=1))
    return attempts_of(hands, scenes, Nuisances(2 * numbers, 3 * numbers, 4 * numbers))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_hands_come_back(dtype: torch.dtype) -> None:
    hands = some_hands(dtype)
    attempts = rows_of(hands)
    back = hands_of(attempts)
    assert attempts.quaternion.dtype == np.float32
    torch.testing.assert_close(back.position, hands.position.reshape(-1, 3).float(), rtol=0, atol=0)
    assert so3.geodesic_distance(back.rotation.double(), hands.rotation.reshape(-1, 3, 3).double()).max() < 1e-6
    assert torch.equal(back.grasp_type, hands.grasp_type.flatten())


def test_every_hand_meets_the_scene_and_nuisances_of_its_row() -> None:
    attempts = rows_of(some_hands())
    numbers = np.arange(12)
    np.testing.assert_array_equal(attempts.object_index, numbers)
    np.testing.assert_array_equal(attempts.scale, 1 + numbers)
    np.testing.assert_array_equal(attempts.object_pose[:, 2], numbers)
    np.testing.assert_array_equal(attempts.mass_factor, 4 * numbers)


def test_quaternions_need_no_unit_length_and_padding_is_the_identity() -> None:
    attempts = rows_of(some_hands())
    columns = (
        c.reshape(*SHAPE, *c.shape[1:]).copy() for c in (attempts.position, attempts.quaternion, attempts.grasp_type)
    )
    position, quaternion, grasp_type = columns
    names = ("position", "quaternion", "grasp_type")
    position, quaternion, grasp_type = (_folded(attempts.columns()[name]) for name in names)
    quaternion[1] *= 3
    quaternion[2, 3] = 0
    back = hands_from(position, quaternion, grasp_type)
    assert back.shape == SHAPE
    torch.testing.assert_close(back.rotation[:2].flatten(0, 1), hands_of(attempts).rotation[:8])
    assert torch.equal(back.rotation[2, 3], torch.eye(3))


def _folded(column: np.ndarray) -> np.ndarray:
    return column.reshape(*SHAPE, *column.shape[1:]).copy()
