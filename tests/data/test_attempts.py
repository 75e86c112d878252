"""Attempts for r(S | h): fresh poses, the chosen share of successes, and the law of the prior under the weights."""

from dataclasses import replace
from pathlib import Path

import fake_world
import numpy as np
import pytest
import torch

from bayesgrasp.data.attempts import AttemptsConfig, PractisedAttempts, RefreshedAttempts, refreshed_attempts
from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import DataError, InvalidConfigurationError
from bayesgrasp.generation.chunks import GenerateConfig
from bayesgrasp.generation.pool import InProcess
from bayesgrasp.generation.run import Run, open_store
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.planar_symmetry import PlanarRefresh
from bayesgrasp.prior.scene import ScenePrior

SMALL = AttemptsConfig(batch_size=256, success_share=0.5, poses=3)
DATA = GenerateConfig(proposal="prior", attempts_per_draw=100, scenes_per_draw=0, draws_per_chunk=60)
REFRESH = PlanarRefresh(GraspPrior(), ScenePrior(fake_world.OBJECTS), fake_world.reachable)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    directory = tmp_path_factory.mktemp("set") / "data"
    Run(open_store(directory, fake_world.manifest(), False), fake_world.recipe(DATA), 30_000).execute(InProcess())
    return GraspDataset(directory)


@pytest.fixture(scope="module")
def attempts(dataset: GraspDataset) -> RefreshedAttempts:
    return refreshed_attempts(dataset, REFRESH, SMALL)[0]


def together(batches: list[Batch]) -> tuple[torch.Tensor, ...]:
    fields = [(b.hands.position, b.success, b.weight) for b in batches]
    return tuple(torch.cat(column)[:, 0] for column in zip(*fields, strict=True))


def test_an_epoch_is_whole_batches_and_the_same_when_asked_again(attempts: RefreshedAttempts) -> None:
    first, again, other = (list(attempts.batches(epoch)) for epoch in (0, 0, 1))
    assert len(first) == len(attempts)
    assert all(b.success.shape == (256, 1) and b.success.sum() == 128 for b in first)
    assert all(torch.equal(a.hands.position, b.hands.position) for a, b in zip(first, again, strict=True))
    assert not torch.equal(first[0].hands.position, other[0].hands.position)


def test_successes_stand_in_poses_of_their_own(attempts: RefreshedAttempts) -> None:
    position, success, _ = together(list(attempts.batches(0)))
    found = position[success == 1]
    assert len(found) >= SMALL.poses * len(attempts.rows[0])
    assert len(torch.unique(found, dim=0)) == len(found)


def test_weighted_attempts_follow_the_prior_and_the_simulator(attempts: RefreshedAttempts) -> None:
    """Rate of success, and the place of hands given success and failure, as in the stored attempts."""
    position, success, weight = together([b for epoch in range(4) for b in attempts.batches(epoch)])
    share = len(attempts.rows[0]) / sum(map(len, attempts.rows))
    assert float((weight * success).sum() / weight.sum()) == pytest.approx(share, rel=1e-5)
    for rows, outcome in zip(attempts.rows, (1, 0), strict=True):
        stored = attempts.columns["position"][rows]
        mine = position[success == outcome]
        error = stored.std(0) / np.sqrt(len(stored))
        np.testing.assert_array_less(np.abs(mine.mean(0).numpy() - stored.mean(0)), 4 * error)


def test_moved_successes_stay_where_the_arm_reaches(attempts: RefreshedAttempts) -> None:
    near = replace(REFRESH, reachable=lambda there: there.position[:, 0] < 0.03)
    away = []
    for refresh in (near, replace(REFRESH, reachable=None)):
        position, success, _ = together(list(replace(attempts, refresh=refresh).batches(0)))
        away.append(float((position[success == 1, 0] > 0.03).float().mean()))
    assert away[0] < 0.02
    assert away[1] > 0.2


def test_held_out_attempts_are_of_other_draws(dataset: GraspDataset) -> None:
    training, held_out = refreshed_attempts(dataset, REFRESH, SMALL)
    draws = [set(dataset.attempt_columns["draw"][np.concatenate(part.rows)].tolist()) for part in (training, held_out)]
    assert all(draws)
    assert not draws[0] & draws[1]


def test_held_out_attempts_are_moved_once(dataset: GraspDataset) -> None:
    held_out = refreshed_attempts(dataset, REFRESH, SMALL)[1]
    kept, again, made = (list(one.batches(epoch)) for one, epoch in _thrice(held_out))
    assert all(a is b for a, b in zip(kept, again, strict=True))
    assert all(torch.equal(a.hands.position, b.hands.position) for a, b in zip(kept, made, strict=True))


def _thrice(held_out: RefreshedAttempts) -> list[tuple[RefreshedAttempts, int]]:
    """Asked for two epochs, and the first one made anew."""
    return [(held_out, 0), (held_out, 1), (replace(held_out, kept=False), 0)]


def test_attempts_without_success_are_refused(tmp_path: Path) -> None:
    store = open_store(tmp_path / "data", fake_world.manifest(), False)
    Run(store, fake_world.recipe(replace(DATA, attempts_per_draw=2, draws_per_chunk=5)), 10).execute(InProcess())
    with pytest.raises(DataError, match="0 successes"):
        len(refreshed_attempts(GraspDataset(tmp_path / "data"), REFRESH, SMALL)[0])


@pytest.mark.parametrize("wrong", [{"batch_size": 1}, {"success_share": 1.0}, {"poses": 0}])
def test_impossible_configurations_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidConfigurationError, match=next(iter(wrong))):
        AttemptsConfig(**wrong)  # type: ignore[arg-type]


def test_an_epoch_of_practice_shows_each_attempt_once_and_chooses_none_by_its_outcome(dataset: GraspDataset) -> None:
    source = PractisedAttempts(dataset.attempt_columns, "train", batch_size=512)
    first, again, other = (list(source.batches(epoch)) for epoch in (0, 0, 1))
    assert len(first) == len(source) == len(source.rows) // 512
    position = torch.cat([batch.hands.position for batch in first])[:, 0]
    assert len(torch.unique(position, dim=0)) == 512 * len(source)
    assert all(bool((batch.selection_weight == 1).all()) for batch in first)
    assert torch.equal(first[0].hands.position, again[0].hands.position)
    assert not torch.equal(first[0].hands.position, other[0].hands.position)


def test_little_practice_is_one_batch_and_none_is_refused(dataset: GraspDataset) -> None:
    few = {name: column[:300] for name, column in dataset.attempt_columns.items()}
    (batch,) = PractisedAttempts(few, "train").batches(0)
    assert len(batch.success) == len(PractisedAttempts(few, "train").rows) < 300
    with pytest.raises(DataError, match="no test attempts"):
        len(PractisedAttempts({name: column[:50] for name, column in few.items()}, "test"))
