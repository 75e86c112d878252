"""Scenes, nuisances and the camera: distributions of the paper's table, weights, supports, and refused parameters."""

import math

import numpy as np
import pytest
from scipy import stats

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.prior.nuisance import CameraPrior, NuisancePrior
from bayesgrasp.prior.ranges import uniform
from bayesgrasp.prior.scene import ScenePrior

N = 20_000


def follows(values: np.ndarray, low: float, high: float) -> bool:
    return bool(stats.kstest(values, "uniform", (low, high - low)).pvalue > 1e-4)


def test_scenes_follow_the_table() -> None:
    prior = ScenePrior(7)
    scenes = prior.sample(N, np.random.default_rng(0))
    assert len(scenes) == N
    assert stats.chisquare(np.bincount(scenes.object_index, minlength=7)).pvalue > 1e-4
    assert follows(scenes.scale, 0.9, 1.1)
    assert follows(scenes.object_pose[:, 0], -0.05, 0.05)
    assert follows(scenes.object_pose[:, 1], -0.05, 0.05)
    assert follows(scenes.object_pose[:, 2], -math.pi, math.pi)
    assert prior.in_support(scenes).all()


def test_weights_choose_objects() -> None:
    prior = ScenePrior(3, weights=(1.0, 0.0, 3.0))
    scenes = prior.sample(N, np.random.default_rng(1))
    counts = np.bincount(scenes.object_index, minlength=3)
    assert counts[1] == 0
    assert stats.chisquare(counts[[0, 2]], [N / 4, 3 * N / 4]).pvalue > 1e-4
    assert not prior.in_support(ScenePrior(3).sample(100, np.random.default_rng(2))).all()


def test_support_of_scenes() -> None:
    prior = ScenePrior(2, yaw=(-0.5, 0.5))
    scenes = prior.sample(6, np.random.default_rng(3))
    scenes.object_pose[0, 0] = 0.06
    scenes.scale[1] = 1.2
    scenes.object_index[2] = 5
    scenes.object_pose[3, 2] = 1.0
    scenes.object_pose[4, 2] = 2 * math.pi  # a full turn from 0
    assert prior.in_support(scenes).tolist() == [False, False, False, False, True, True]


def test_nuisances_follow_their_intervals() -> None:
    nuisances = NuisancePrior().sample(N, np.random.default_rng(4))
    assert follows(nuisances.lateral_friction, 0.6, 1.0)
    assert follows(nuisances.spinning_friction, 0.002, 0.006)
    assert follows(nuisances.mass_factor, 0.9, 1.1)


def test_the_papers_nuisances_are_two_percent() -> None:
    nuisances = NuisancePrior.paper().sample(N, np.random.default_rng(5))
    assert follows(nuisances.lateral_friction, 0.8 * 0.98, 0.8 * 1.02)
    assert (nuisances.mass_factor == 1).all()


def test_camera_nuisances() -> None:
    prior = CameraPrior()
    camera = prior.sample(N, np.random.default_rng(6))
    # Standard deviations are known to 1 / sqrt(2 N) = 0.5 %.
    np.testing.assert_allclose(camera.rotation_vector.std(0), [0.002, 0.01, 0.002], rtol=0.03)
    np.testing.assert_allclose(camera.rotation_vector.mean(0), 0.0, atol=3e-4)
    assert follows(camera.position_offset[:, 0], -0.008, 0.008)
    assert (camera.position_offset[:, 1] == 0).all()  # 2 % of a coordinate that is 0
    assert follows(camera.position_offset[:, 2], -0.014, 0.014)
    assert follows(camera.near, 0.441, 0.459)
    assert follows(camera.far, 3.92, 4.08)
    assert follows(camera.field_of_view_factor, 0.98, 1.02)


def test_nominal_position_is_that_of_the_canonical_camera() -> None:
    np.testing.assert_allclose(CameraPrior().position, canonical_camera().pose[:3, 3], atol=1e-12)


def test_no_error_gives_the_nominal_camera() -> None:
    camera = CameraPrior(relative_error=0.0, rotation_deviation=(0.0, 0.0, 0.0)).sample(3, np.random.default_rng(7))
    assert (camera.position_offset == 0).all()
    assert (camera.rotation_vector == 0).all()
    np.testing.assert_allclose(camera.near, 0.45)


def test_uniform_draws_stay_inside_after_rounding() -> None:
    draws = uniform(np.random.default_rng(8), (0.1, 0.1 + 1e-9), 1000).astype(np.float64)
    assert np.abs(draws - 0.1).max() < 1e-8  # no float32 number is inside: the nearest
    draws = uniform(np.random.default_rng(9), (0.1, 0.1 + 2e-8), 1000).astype(np.float64)
    assert draws.min() >= 0.1
    assert draws.max() <= 0.1 + 2e-8


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: ScenePrior(0), "at least one object"),
        (lambda: ScenePrior(2, weights=(1.0,)), "weights must be 2"),
        (lambda: ScenePrior(2, weights=(1.0, -1.0)), ">= 0"),
        (lambda: ScenePrior(2, weights=(0.0, 0.0)), "positive sum"),
        (lambda: ScenePrior(2, scale=(-1.0, 1.0)), "scale"),
        (lambda: ScenePrior(2, x=(math.nan, 1.0)), "x must be"),
        (lambda: NuisancePrior(lateral_friction=(-0.1, 1.0)), "lateral_friction"),
        (lambda: NuisancePrior(spinning_friction=(0.2, 0.1)), "spinning_friction"),
        (lambda: NuisancePrior(mass_factor=(0.0, 1.0)), "mass_factor"),
        (lambda: CameraPrior(near=1.0, far=0.5), "near < far"),
        (lambda: CameraPrior(relative_error=1.0), "relative_error"),
        (lambda: CameraPrior(rotation_deviation=(0.0, -0.1, 0.0)), "rotation_deviation"),
        (lambda: CameraPrior(position=(0.0, 0.0, math.inf)), "position"),
    ],
)
def test_bad_parameters_are_refused_by_name(build, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InvalidConfigurationError, match=message):
        build()
