"""One loop: it learns, repeats itself, goes on where it was killed, stops early, and leaves the caller alone."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from torch import Tensor, nn

from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import CheckpointError, DataError, InvalidConfigurationError
from bayesgrasp.ratio.estimators import ImageConfig, SuccessRatioConfig
from bayesgrasp.ratio.kinds import build
from bayesgrasp.ratio.layers import ConvConfig
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.seeding import generator
from bayesgrasp.training.objectives import ImageObjective, SuccessRatioObjective
from bayesgrasp.training.sources import Source, Sources
from bayesgrasp.training.train_estimator import (
    Progress,
    Result,
    TrainConfig,
    average_into,
    initialised,
    learning_rate,
    train_estimator,
)
from bayesgrasp.types import Hands

CONFIG = TrainConfig(epochs=3, save_every=2, bf16=False)
OBJECTIVE = ImageObjective(hands=4, shifts=1)
Build = Callable[[], nn.Module]


@pytest.fixture
def make(encoder: ConvConfig) -> Build:
    config = ImageConfig(encoder=encoder, widths=(16, 16))
    return lambda: build("image", config)


def both(source: Source) -> Sources:
    """The same batches to learn from and to validate on."""
    return Sources(source, source)


def weights(result: Result) -> dict[str, Tensor]:
    return result.estimator.state_dict()


def same(left: Result, right: Result) -> bool:
    return all(torch.equal(a, weights(right)[name]) for name, a in weights(left).items())


class KilledError(Exception):
    """Stands for the end of the process."""


def killer(steps: int) -> Callable[[Progress], None]:
    """A callback that ends the run after so many steps."""

    def callback(progress: Progress) -> None:
        if progress.epoch * progress.steps + progress.step + 1 == steps:
            raise KilledError

    return callback


def test_the_same_seed_gives_the_same_weights_and_another_one_does_not(make: Build, source: Source) -> None:
    runs = [train_estimator(make, OBJECTIVE, both(source), replace(CONFIG, seed=seed)) for seed in (1, 1, 2)]
    assert same(runs[0], runs[1])
    assert not same(runs[0], runs[2])


@pytest.mark.parametrize("steps", [1, 2, 5, 7, 10, 14, 15])
def test_a_killed_run_goes_on_exactly(make: Build, source: Source, tmp_path: Path, steps: int) -> None:
    """Killed after any number of steps, between or at saved states (every 2 steps, and 5 steps an epoch)."""
    expected = train_estimator(make, OBJECTIVE, both(source), CONFIG)
    state = tmp_path / "state.safetensors"
    with pytest.raises(KilledError):
        train_estimator(make, OBJECTIVE, both(source), CONFIG, state_file=state, callback=killer(steps))
    resumed = train_estimator(make, OBJECTIVE, both(source), CONFIG, state_file=state, resume=True)
    assert same(resumed, expected)
    assert (resumed.train, resumed.validation) == (expected.train, expected.validation)


def test_another_run_s_state_is_refused(make: Build, source: Source, tmp_path: Path) -> None:
    state = tmp_path / "state.safetensors"
    train_estimator(make, OBJECTIVE, both(source), replace(CONFIG, epochs=1), state_file=state)
    with pytest.raises(CheckpointError, match="another run"):
        train_estimator(make, OBJECTIVE, both(source), CONFIG, state_file=state, resume=True)


def test_the_state_of_other_data_of_the_same_size_is_refused(make: Build, source: Source, tmp_path: Path) -> None:
    state = tmp_path / "state.safetensors"
    train_estimator(make, OBJECTIVE, replace(both(source), identity="one"), CONFIG, state_file=state)
    with pytest.raises(CheckpointError, match=r"it was saved with 'one'.*, this run has 'two'") as refused:
        train_estimator(make, OBJECTIVE, replace(both(source), identity="two"), CONFIG, state_file=state, resume=True)
    assert len(str(refused.value)) < 400


def test_no_flipped_bit_of_a_state_passes(make: Build, source: Source, tmp_path: Path) -> None:
    state = tmp_path / "state.safetensors"
    train_estimator(make, OBJECTIVE, both(source), replace(CONFIG, epochs=1), state_file=state)
    whole = state.read_bytes()
    for number in range(40):
        place, bit = divmod(int(generator(number).integers(8 * len(whole))), 8)
        state.write_bytes(whole[:place] + bytes([whole[place] ^ (1 << bit)]) + whole[place + 1 :])
        with pytest.raises(CheckpointError) as refused:
            train_estimator(make, OBJECTIVE, both(source), replace(CONFIG, epochs=1), state_file=state, resume=True)
        assert len(str(refused.value)) < 400


@pytest.mark.parametrize("content", [b"", b"not a state", b"\x08\x00\x00\x00\x00\x00\x00\x00{}      "])
def test_a_damaged_state_is_refused(make: Build, source: Source, tmp_path: Path, content: bytes) -> None:
    state = tmp_path / "state.safetensors"
    state.write_bytes(content)
    with pytest.raises(CheckpointError, match="state"):
        train_estimator(make, OBJECTIVE, both(source), CONFIG, state_file=state, resume=True)


def test_it_learns_that_success_depends_on_the_height(source: Source) -> None:
    schedule = TrainConfig(epochs=30, learning_rate=1e-2, average=0.9)
    result = train_estimator(
        lambda: build("success_ratio", SuccessRatioConfig()), SuccessRatioObjective(), both(source), schedule
    )
    assert result.validation[-1] < 0.9 * result.validation[0]
    assert result.stopped == "epochs"
    low, high = (Hands(torch.tensor([0.0, 0.0, z]), torch.eye(3), torch.tensor(0)) for z in (0.15, 0.31))
    ratio = GraspModel({"success_ratio": result.estimator}, {}).given_success()
    assert ratio(high) - ratio(low) > 1


class Worsening:
    """An objective that gets worse with every call in evaluation, so that the first epoch stays the best."""

    def __init__(self) -> None:
        self.calls = 0

    def loss(self, estimator: nn.Module, batch: Batch, rng: torch.Generator) -> Tensor:
        self.calls += not estimator.training
        return next(iter(estimator.parameters())).square().sum() + self.calls


def test_early_stopping_returns_the_best_epoch(make: Build, source: Source) -> None:
    result = train_estimator(make, Worsening(), both(source), replace(CONFIG, epochs=9, patience=2))
    assert result.stopped == "patience"
    assert (result.best_epoch, len(result.validation)) == (0, 3)


def test_progress_is_told_for_every_step(make: Build, source: Source) -> None:
    told: list[Progress] = []
    result = train_estimator(make, OBJECTIVE, both(source), CONFIG, callback=told.append)
    assert [(p.epoch, p.step) for p in told] == [(e, s) for e in range(3) for s in range(5)]
    assert [p.validation for p in told if p.step == 4] == list(result.validation)
    assert all(p.validation is None for p in told if p.step < 4)


def test_bfloat16_learns_what_single_precision_learns(make: Build, source: Source) -> None:
    runs = [train_estimator(make, OBJECTIVE, both(source), replace(CONFIG, bf16=bf16)) for bf16 in (False, True)]
    assert all(p.dtype == torch.float32 for p in runs[1].estimator.parameters())
    assert runs[1].validation[-1] == pytest.approx(runs[0].validation[-1], rel=0.02)


def test_the_learning_rate_rises_and_falls() -> None:
    config = TrainConfig(learning_rate=1.0, warmup=0.1)
    rates = [learning_rate(step, 100, config) for step in range(100)]
    assert rates[9] == 1.0
    assert rates[:10] == sorted(rates[:10])
    assert rates[10:] == sorted(rates[10:], reverse=True)
    assert rates[-1] < 1e-3


def test_averaging_moves_parameters_and_copies_counters() -> None:
    averaged, current = nn.BatchNorm1d(2), nn.BatchNorm1d(2)
    nn.init.constant_(current.weight, 3.0)
    current.num_batches_tracked += 4
    average_into(averaged, current, 0.75)
    assert averaged.weight.tolist() == [1.5, 1.5]
    assert averaged.num_batches_tracked == 4


def test_initial_weights_leave_the_caller_s_random_state(make: Build) -> None:
    before = torch.get_rng_state()
    initialised(make, 3)
    assert torch.equal(before, torch.get_rng_state())


def test_no_data_is_an_error(make: Build, source: Source) -> None:
    empty = type(source)([])  # type: ignore[call-arg]
    with pytest.raises(DataError, match="training scenes"):
        train_estimator(make, OBJECTIVE, Sources(empty, source), CONFIG)
    with pytest.raises(DataError, match="held-out scenes"):
        train_estimator(make, OBJECTIVE, Sources(source, empty), CONFIG)


@pytest.mark.parametrize(
    "wrong",
    [
        {"epochs": 0},
        {"learning_rate": 0.0},
        {"warmup": 1.0},
        {"average": 1.0},
        {"patience": -1},
        {"clip": 0.0},
        {"mirror": 1.5},
    ],
)
def test_invalid_schedules_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidConfigurationError, match=next(iter(wrong))):
        TrainConfig(**wrong)  # type: ignore[arg-type]
