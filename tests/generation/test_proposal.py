"""The adaptive proposal: its density is the law that it draws from, and its weights are bounded."""

from dataclasses import replace

import fake_world
import numpy as np
import pytest

from bayesgrasp.data.schema import AttemptRecords
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.chunks import ChunkMaker, GenerateConfig, World
from bayesgrasp.generation.proposal import AdaptiveConfig, Proposal, learn
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import Outcome

SCENE = ScenePrior(fake_world.OBJECTS)
WORLD = World(fake_world.lift_test, fake_world.render, fake_world.reachable)


def config(**adaptive: float) -> GenerateConfig:
    return GenerateConfig(
        proposal="adaptive",
        attempts_per_draw=200,
        draws_per_chunk=120,
        scenes_per_draw=0,
        adaptive=AdaptiveConfig(**adaptive),  # type: ignore[arg-type]
    )


def run(settings: GenerateConfig, chunk: int, proposal: Proposal) -> AttemptRecords:
    maker = ChunkMaker(WORLD, settings, 7, SCENE)
    records = maker.propose(chunk, settings.attempts_per_chunk, proposal)
    return replace(records, outcome=fake_world.lift_test(records))


@pytest.fixture(scope="module")
def pilot() -> AttemptRecords:
    return run(config(), 0, Proposal.prior(fake_world.OBJECTS))


@pytest.fixture(scope="module", params=[{}, {"position_deviation": 0.06, "kappa": 20.0, "prior_share": 0.2}])
def adapted(request: pytest.FixtureRequest, pilot: AttemptRecords) -> tuple[GenerateConfig, AttemptRecords]:
    settings = config(**request.param)
    proposal = learn(pilot, fake_world.OBJECTS, settings.adaptive, np.random.default_rng(0))
    return settings, run(settings, 1, proposal)


def within(weighted: np.ndarray, plain: np.ndarray) -> bool:
    error = np.sqrt(weighted.var() / len(weighted) + plain.var() / len(plain))
    # Attempts of one draw share their object, which the independent error above does not know: hence 5, not 3.
    return abs(weighted.mean() - plain.mean()) <= 5 * error


def test_weights_are_bounded_and_average_to_one(adapted: tuple[GenerateConfig, AttemptRecords]) -> None:
    settings, records = adapted
    weight = np.exp(records.log_weight.astype(np.float64))
    assert weight.max() <= 1 / settings.adaptive.prior_share * (1 + 1e-5)
    assert np.exp(records.object_log_weight).max() <= 2 + 1e-5
    for index in range(fake_world.OBJECTS):
        mine = weight[records.object_index == index]
        assert mine.mean() == pytest.approx(1, abs=4.5 * mine.std() / np.sqrt(len(mine)))


@pytest.mark.parametrize("index", range(fake_world.OBJECTS))
def test_weighted_outcomes_agree_with_the_prior(
    index: int, adapted: tuple[GenerateConfig, AttemptRecords], pilot: AttemptRecords
) -> None:
    _, records = adapted
    mine, reference = records[records.object_index == index], pilot[pilot.object_index == index]
    weight = np.exp(mine.log_weight.astype(np.float64))
    for outcome in Outcome:
        assert within(weight * (mine.outcome == outcome), 1.0 * (reference.outcome == outcome)), outcome


def test_weighted_hands_agree_with_the_prior(
    adapted: tuple[GenerateConfig, AttemptRecords], pilot: AttemptRecords
) -> None:
    _, records = adapted
    weight = np.exp(records.log_weight.astype(np.float64))
    for grasp_type in range(3):
        assert within(weight * (records.grasp_type == grasp_type), 1.0 * (pilot.grasp_type == grasp_type))
    for column in range(3):
        assert within(weight * records.position[:, column], pilot.position[:, column].astype(np.float64))
        assert within(weight * records.quaternion[:, column] ** 2, pilot.quaternion[:, column].astype(np.float64) ** 2)
    assert (records.position >= np.float32([-0.15, -0.15, 0.12])).all()
    assert (records.position <= np.float32([0.15, 0.15, 0.34])).all()


def test_it_succeeds_far_more_often(adapted: tuple[GenerateConfig, AttemptRecords], pilot: AttemptRecords) -> None:
    _, records = adapted
    assert (records.outcome == Outcome.SUCCESS).mean() > 2 * (pilot.outcome == Outcome.SUCCESS).mean()


def test_hard_objects_are_tried_more(adapted: tuple[GenerateConfig, AttemptRecords], pilot: AttemptRecords) -> None:
    _, _ = adapted
    proposal = learn(pilot, fake_world.OBJECTS, AdaptiveConfig(), np.random.default_rng(0))
    assert proposal.objects.sum() == pytest.approx(1)
    assert np.all(np.diff(proposal.objects) > 0)  # the radii of success shrink with the index
    assert proposal.objects.min() >= 0.5 / fake_world.OBJECTS


def test_an_object_without_success_keeps_the_prior(pilot: AttemptRecords) -> None:
    only = pilot[pilot.object_index != 1]
    proposal = learn(only, fake_world.OBJECTS, AdaptiveConfig(), np.random.default_rng(0))
    assert proposal.kernels[1] is None
    records = run(config(), 2, proposal)[:2000]
    assert (records.log_weight[records.object_index == 1] == 0).all()


def test_rounds_cover_the_chunks_in_order() -> None:
    settings = AdaptiveConfig(first_round=3, rounds=2)
    assert [settings.round_of(c) for c in range(14)] == [0, 0, 0, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2]
    assert [settings.round_start(r) for r in range(3)] == [0, 3, 6]


@pytest.mark.parametrize(
    "bad", [{"prior_share": 0.0}, {"position_deviation": 0.0}, {"kappa": -1.0}, {"type_change": 0.0}, {"rounds": 0}]
)
def test_bad_settings_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(InvalidConfigurationError):
        AdaptiveConfig(**bad)  # type: ignore[arg-type]
