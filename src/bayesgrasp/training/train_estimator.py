"""One training loop for every estimator: AdamW, warm-up and cosine, clipping, averaged weights, early stopping.

An estimator differs from another only by its objective. Weights are averaged exponentially along the way (EMA); the
average is what is validated, kept and returned. Early stopping watches the same objective on held-out scenes.

Nothing depends on hidden random state: the weights start from the seed, the objective of step t draws from the stream
at (seed, t), and the source gives the same batches for an epoch whenever it is asked. So a run that was killed and
resumed ends with the weights of an undisturbed run, and one seed gives one set of weights on one machine.
"""

import copy
import itertools
import logging
import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import nn

from bayesgrasp.data.schema import Batch
from bayesgrasp.errors import DataError, InvalidConfigurationError
from bayesgrasp.seeding import Stream, torch_generator
from bayesgrasp.training.mirror import mirrored_at_random
from bayesgrasp.training.objectives import Objective
from bayesgrasp.training.quarter_turns import turned_at_random
from bayesgrasp.training.sources import Source, Sources
from bayesgrasp.training.state import TrainingState, load_state, save_state

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class TrainConfig:
    """How an estimator is trained.

    Attributes:
        epochs: Passes over the training scenes, at most.
        learning_rate: Its peak.
        weight_decay: Decoupled weight decay.
        warmup: Share of all steps in which the rate rises; it then falls to 0 as a cosine.
        clip: Largest norm of the gradient.
        average: Decay of the averaged weights per step.
        patience: Epochs without improvement on held-out scenes before stopping; 0 never stops early.
        bf16: Autocast to bfloat16.
        mirror: Share of the training scenes that are mirrored afresh in every epoch (`mirror.py`).
        turn: Turn every training scene by a random number of quarter turns (`quarter_turns.py`).
        save_every: Steps between two saved states; one is also saved after every epoch.
        seed: Of the weights' start and of the objective's draws.
    """

    epochs: int = 20
    learning_rate: float = 1e-3
    weight_decay: float = 1e-2
    warmup: float = 0.05
    clip: float = 1.0
    average: float = 0.998
    patience: int = 0
    bf16: bool = True
    mirror: float = 0.0
    turn: bool = False
    save_every: int = 500
    seed: int = 0

    def __post_init__(self) -> None:
        if self.epochs < 1 or self.save_every < 1 or self.patience < 0:
            raise InvalidConfigurationError(f"need epochs and save_every >= 1 and patience >= 0, got {self}")
        if self.learning_rate <= 0 or self.clip <= 0 or self.weight_decay < 0:
            raise InvalidConfigurationError(f"need learning_rate and clip > 0 and weight_decay >= 0, got {self}")
        if not 0 <= self.mirror <= 1:
            raise InvalidConfigurationError(f"mirror must be a share in [0, 1], got {self.mirror}")
        if not (0 <= self.warmup < 1 and 0 <= self.average < 1):
            raise InvalidConfigurationError(f"warmup and average must lie in [0, 1), got {self}")


@dataclass(frozen=True)
class Progress:
    """What a callback is told after every step.

    Attributes:
        epoch, step: Counted from 0; the step within the epoch.
        epochs, steps: How many there are.
        loss: On this batch.
        learning_rate: Used in this step.
        validation: Loss on held-out scenes, after the last step of an epoch only.
    """

    epoch: int
    step: int
    epochs: int
    steps: int
    loss: float
    learning_rate: float
    validation: float | None = None


@dataclass(frozen=True)
class Result:
    """A trained estimator and how training went.

    Attributes:
        estimator: With the averaged weights of the best epoch, in evaluation mode.
        train, validation: Mean losses by epoch.
        best_epoch: Of the returned weights.
        stopped: ``epochs`` (all done) or ``patience`` (no improvement for as long as configured).
        seconds: Wall-clock time of this call.
    """

    estimator: nn.Module
    train: tuple[float, ...]
    validation: tuple[float, ...]
    best_epoch: int
    stopped: str
    seconds: float


@dataclass
class _Run:
    """The parts of one training run, and the operations on them."""

    estimator: nn.Module
    objective: Objective
    config: TrainConfig
    device: torch.device
    steps: int
    averaged: nn.Module = field(init=False)
    best: nn.Module = field(init=False)
    optimizer: torch.optim.Optimizer = field(init=False)

    def __post_init__(self) -> None:
        self.averaged, self.best = copy.deepcopy(self.estimator), copy.deepcopy(self.estimator)
        rate, decay = self.config.learning_rate, self.config.weight_decay
        self.optimizer = torch.optim.AdamW(self.estimator.parameters(), lr=rate, weight_decay=decay)

    def autocast(self) -> AbstractContextManager[None]:
        return torch.autocast(self.device.type, torch.bfloat16, enabled=self.config.bf16)

    def step(self, batch: Batch, count: int) -> tuple[float, float]:
        """One update; the loss and the learning rate."""
        rate = learning_rate(count, self.steps * self.config.epochs, self.config)
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        batch = mirrored_at_random(batch, self.config.mirror, torch_generator(self.config.seed, Stream.MIRROR, count))
        if self.config.turn:
            batch = turned_at_random(batch, torch_generator(self.config.seed, Stream.QUARTER_TURN, count))
        with self.autocast():
            loss = self.objective.loss(self.estimator, batch, torch_generator(self.config.seed, Stream.PAIRING, count))
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(self.estimator.parameters(), self.config.clip)
        self.optimizer.step()
        average_into(self.averaged, self.estimator, min(self.config.average, (1 + count) / (10 + count)))
        return float(loss.detach()), rate

    def validate(self, source: Source) -> float:
        """Mean loss of the averaged weights on held-out scenes, always on the same draws."""
        self.averaged.eval()
        total, count = 0.0, 0
        with torch.no_grad(), self.autocast():
            for batch in source.batches(0):
                rng = torch_generator(self.config.seed, Stream.VALIDATION, count)
                total += float(self.objective.loss(self.averaged, batch.to(self.device), rng))
                count += 1
        if count == 0:
            raise DataError("there are no held-out scenes: validation needs at least one batch")
        return total / count


def train_estimator(
    build: Callable[[], nn.Module],
    objective: Objective,
    sources: Sources,
    config: TrainConfig,
    *,
    device: torch.device | str = "cpu",
    state_file: Path | None = None,
    resume: bool = False,
    callback: Callable[[Progress], None] | None = None,
) -> Result:
    """Train one estimator.

    Args:
        build: Makes the estimator; its initial weights come from the seed, whatever the caller's random state.
        objective: Its loss.
        sources: Batches to learn from, and held-out ones for early stopping.
        config: See `TrainConfig`.
        device: Where to train; the result is on the CPU.
        state_file: Where the state is saved for `resume`; not saved if None.
        resume: Go on from `state_file` if it exists.
        callback: Called after every step.

    Raises:
        DataError: No batches.
        CheckpointError: The saved state is damaged or belongs to another run.
    """
    start, device = time.perf_counter(), torch.device(device)
    if len(sources.training) == 0:
        raise DataError("there are no training scenes: an epoch needs at least one batch")
    run = _Run(initialised(build, config.seed).to(device), objective, config, device, len(sources.training))
    described = (config, objective, run.steps, getattr(run.estimator, "config", None), sources.identity)
    state = TrainingState(fingerprint=repr(described))
    if resume and state_file is not None and state_file.exists():
        state = load_state(state_file, state.fingerprint, run.estimator, run.averaged, run.best, run.optimizer)
    while not _finished(state, config):
        _epoch(run, state, sources, state_file, callback)
    stopped = "epochs" if state.epoch >= config.epochs else "patience"
    best = run.best.cpu().eval()
    seconds = time.perf_counter() - start
    return Result(best, tuple(state.train), tuple(state.validation), state.best_epoch, stopped, seconds)


def learning_rate(count: int, total: int, config: TrainConfig) -> float:
    """Linear warm-up, then a cosine to zero."""
    warmup = max(1, round(config.warmup * total))
    if count < warmup:
        return config.learning_rate * (count + 1) / warmup
    return config.learning_rate * 0.5 * (1.0 + math.cos(math.pi * (count - warmup) / max(1, total - warmup)))


def initialised(build: Callable[[], nn.Module], seed: int) -> nn.Module:
    """An estimator whose weights depend on the seed alone; the caller's random state is left alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(int(torch_generator(seed, Stream.WEIGHTS).initial_seed()) % 2**63)
        return build()


def average_into(averaged: nn.Module, estimator: nn.Module, decay: float) -> None:
    """Averaged <- decay averaged + (1 - decay) estimator; statistics of batch norms alike, counters copied."""
    with torch.no_grad():
        targets, sources = ([*m.parameters(), *m.buffers()] for m in (averaged, estimator))
        moving = [(a, b) for a, b in zip(targets, sources, strict=True) if a.is_floating_point()]
        torch._foreach_lerp_([a for a, _ in moving], [b for _, b in moving], 1.0 - decay)
        for target, source in zip(targets, sources, strict=True):
            if not target.is_floating_point():
                target.copy_(source)


def _finished(state: TrainingState, config: TrainConfig) -> bool:
    waited = state.epoch - 1 - state.best_epoch
    return state.epoch >= config.epochs or (0 < config.patience <= waited)


def _epoch(
    run: _Run,
    state: TrainingState,
    sources: Sources,
    state_file: Path | None,
    callback: Callable[[Progress], None] | None,
) -> None:
    run.estimator.train()
    for batch in itertools.islice(sources.training.batches(state.epoch), state.step, run.steps):
        count = state.epoch * run.steps + state.step
        loss, rate = run.step(batch.to(run.device), count)
        state.step += 1
        state.loss_sum += loss
        last = state.step == run.steps
        validation = _close_epoch(run, state, sources.held_out) if last else None
        if state_file is not None and (last or state.step % run.config.save_every == 0):
            save_state(state_file, state, run.estimator, run.averaged, run.best, run.optimizer)
        if callback is not None:
            epoch, step = divmod(count, run.steps)
            callback(Progress(epoch, step, run.config.epochs, run.steps, loss, rate, validation))


def _close_epoch(run: _Run, state: TrainingState, held_out: Source) -> float:
    validation = run.validate(held_out)
    if not math.isfinite(validation):
        logger.warning("the validation loss of epoch %d is %s", state.epoch, validation)
    if not state.validation or validation < state.validation[state.best_epoch]:
        state.best_epoch = state.epoch
        run.best.load_state_dict(run.averaged.state_dict())
    state.train.append(state.loss_sum / run.steps)
    state.validation.append(validation)
    state.epoch, state.step, state.loss_sum = state.epoch + 1, 0, 0.0
    return validation
