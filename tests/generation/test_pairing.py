"""The hands of a scene: whatever is chosen, the weights make them stand for the prior."""

from dataclasses import replace

import fake_world
import numpy as np
import pytest

from bayesgrasp.data.schema import AttemptRecords, HandRecords
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.generation.chunks import ChunkMaker, GenerateConfig, World
from bayesgrasp.generation.pairing import DrawPairing, PairingConfig, inclusion_probabilities, systematic
from bayesgrasp.generation.proposal import AdaptiveConfig, Proposal, learn
from bayesgrasp.prior.planar_symmetry import PlanarRefresh
from bayesgrasp.prior.scene import ScenePrior
from bayesgrasp.types import Attempts, Outcome

SCENE = ScenePrior(fake_world.OBJECTS)
FRICTION = 0.85


def slippery(attempts: Attempts) -> np.ndarray:
    """As the fake lift test, but only hands on objects with enough friction hold them."""
    outcome = fake_world.lift_test(attempts)
    lost = (outcome == Outcome.SUCCESS) & (attempts.lateral_friction < FRICTION)
    return np.where(lost, np.uint8(Outcome.DROPPED), outcome)


def records(settings: GenerateConfig, chunk: int, proposal: Proposal) -> AttemptRecords:
    maker = ChunkMaker(World(fake_world.judged_by(slippery), fake_world.render), settings, 3, SCENE)
    attempts = maker.propose(chunk, settings.attempts_per_chunk, proposal)
    return replace(attempts, outcome=slippery(attempts))


@pytest.fixture(scope="module")
def pilot() -> AttemptRecords:
    settings = GenerateConfig(proposal="prior", attempts_per_draw=1, draws_per_chunk=20_000)
    maker = ChunkMaker(World(fake_world.judged_by(slippery), fake_world.render), settings, 5, SCENE)
    parts = [maker._prior_attempts(i, np.ones(1, np.float32), 20_000, np.random.default_rng(i)) for i in range(3)]
    attempts = Attempts.cat(parts)
    n = len(attempts)
    zeros = np.zeros(n, np.float32)
    return AttemptRecords(
        **attempts.columns(),
        draw=np.arange(n),
        outcome=slippery(attempts),
        held=np.zeros(n, np.uint8),
        log_weight=zeros,
        object_log_weight=zeros,
    )


@pytest.fixture(scope="module", params=[0.5, 1.0], ids=lambda t: f"tempering {t}")
def paired(request: pytest.FixtureRequest, pilot: AttemptRecords) -> tuple[HandRecords, np.ndarray]:
    """Hands of one scene for each of many draws, and the object pose of each."""
    settings = GenerateConfig(proposal="adaptive", attempts_per_draw=64, draws_per_chunk=160, scenes_per_draw=1)
    proposal = learn(pilot, fake_world.OBJECTS, AdaptiveConfig(max_kernels=64), np.random.default_rng(0))
    attempts = records(settings, 0, proposal)
    refresh = PlanarRefresh(settings.grasp, SCENE, fake_world.reachable)
    config = PairingConfig(hands=16, tempering=request.param)
    rng = np.random.default_rng(1)
    poses = SCENE.sample_pose(settings.draws_per_chunk, rng)
    hands = [
        DrawPairing(attempts[attempts.draw == draw], refresh, config).choose(pose.astype(np.float64), rng)
        for draw, pose in enumerate(poses)
    ]
    return HandRecords.cat(hands), poses


def agree(weighted: np.ndarray, plain: np.ndarray) -> bool:
    """Whether the mean over scenes (rows) of a weighted mean over hands is the mean over independent attempts."""
    scene_means = weighted.mean(axis=1)
    error = np.sqrt(scene_means.var() / len(scene_means) + plain.var() / len(plain))
    return abs(scene_means.mean() - plain.mean()) <= 4.5 * error


def test_weighted_hands_follow_the_prior(paired: tuple[HandRecords, np.ndarray], pilot: AttemptRecords) -> None:
    hands, _ = paired
    weight = hands.weight.astype(np.float64)
    assert agree(weight, np.ones(10))
    for outcome in (Outcome.SUCCESS, Outcome.DROPPED, Outcome.COLLISION, Outcome.UNREACHABLE):
        assert agree(weight * (hands.outcome == outcome), 1.0 * (pilot.outcome == outcome)), outcome
    for column in range(3):
        assert agree(weight * hands.position[..., column], pilot.position[:, column].astype(np.float64))
    high = (hands.outcome == Outcome.SUCCESS) * hands.position[..., 2]
    assert agree(weight * high, (pilot.outcome == Outcome.SUCCESS) * pilot.position[:, 2].astype(np.float64))


def test_unweighted_hands_are_mostly_successes(paired: tuple[HandRecords, np.ndarray], pilot: AttemptRecords) -> None:
    hands, _ = paired
    real = hands.source >= 0
    assert (hands.outcome[real] == Outcome.SUCCESS).mean() > 10 * (pilot.outcome == Outcome.SUCCESS).mean()


def test_selection_weights_keep_the_probability_of_success(
    paired: tuple[HandRecords, np.ndarray], pilot: AttemptRecords
) -> None:
    """Where success is a matter of friction alone, its weighted share is the share of enough friction."""
    hands, poses = paired
    flat = Attempts(
        position=hands.position.reshape(-1, 3),
        quaternion=hands.quaternion.reshape(-1, 4),
        grasp_type=hands.grasp_type.reshape(-1),
        object_index=np.full(hands.source.size, 2, np.int32),  # the smallest region, which is inside the others
        scale=np.ones(hands.source.size, np.float32),
        object_pose=np.repeat(poses, hands.source.shape[1], axis=0),
        lateral_friction=hands.lateral_friction.reshape(-1),
        spinning_friction=hands.spinning_friction.reshape(-1),
        mass_factor=hands.mass_factor.reshape(-1),
    )
    undecided = (fake_world.lift_test(flat) == Outcome.SUCCESS) & (hands.source.reshape(-1) >= 0)
    success = hands.outcome.reshape(-1)[undecided] == Outcome.SUCCESS
    weight = hands.selection_weight.reshape(-1)[undecided].astype(np.float64)
    share = (weight * success).sum() / weight.sum()
    expected = (pilot.lateral_friction >= FRICTION).mean()
    error = np.sqrt((weight**2 * (success - expected) ** 2).sum()) / weight.sum()
    assert undecided.sum() > 60
    assert share == pytest.approx(expected, abs=4 * error)
    assert error < 0.08
    assert abs(success.mean() - expected) > 1.5 * error  # without weights it would be wrong


def test_a_moved_hand_out_of_reach_is_unreachable(paired: tuple[HandRecords, np.ndarray]) -> None:
    hands, _ = paired
    x, q = hands.position[..., 0], hands.quaternion[..., 1]
    far = (x >= fake_world.REACH - 0.1 * np.abs(q)) & (hands.source >= 0)
    assert far.any()
    assert (hands.outcome[far] == Outcome.UNREACHABLE).all()


def test_inclusion_probabilities_sum_to_the_count() -> None:
    value = np.array([100.0, 1.0, 1.0, 2.0, 0.5])
    probability = inclusion_probabilities(value, 3)
    assert probability.sum() == pytest.approx(3)
    assert probability[0] == 1
    np.testing.assert_allclose(probability[1:] / value[1:], probability[1] / value[1])
    np.testing.assert_array_equal(inclusion_probabilities(value, 9), 1)


def test_systematic_sampling_takes_each_with_its_probability() -> None:
    probability = np.array([1.0, 0.2, 0.8, 0.5, 0.5])
    rng = np.random.default_rng(0)
    counts = np.zeros(5)
    for _ in range(4000):
        taken = systematic(probability, rng)
        assert len(taken) == 3
        counts[taken] += 1
    np.testing.assert_allclose(counts / 4000, probability, atol=0.03)


@pytest.mark.parametrize("bad", [{"hands": 0}, {"success_share": -0.1}, {"success_share": 0.8}, {"tempering": 2.0}])
def test_bad_settings_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(InvalidConfigurationError):
        PairingConfig(**bad)  # type: ignore[arg-type]
