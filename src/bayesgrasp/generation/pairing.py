r"""Which hands go with an image, and what each of them stands for.

A draw has A attempts (rho_j, S_j) with weights w_j = p(h_j) / q(h_j), and a scene of the draw has a pose p_O ~ p(p_O).
Moved into the scene, attempt j is a hand h'_j = h(rho_j, p_O), and for any f

    E[ 1/A \sum_j omega_j f(h'_j, S_j) ] = E_{p(h)} E_{p(S | h, O, p_O)} f(h, S),    omega_j = w_j p(h'_j) / p(rho_j),

by `planar_symmetry`. Learning needs few hands a scene, successes and near misses more than their share. So each class
of outcomes gets places, and inside a class attempt j is taken with a probability pi_j that is proportional to
v_j = omega_j^tempering, without replacement (systematic sampling). Then

* ``weight`` = K / A * omega_j / pi_j * p(O) / q(O) keeps the expectation above (its mean is 1 over a data set), and
* ``selection_weight`` = K v_j / pi_j / \sum v undoes the preference for some outcomes: under it hands follow a law of
  their own, but S given (h, scene) is right, since v depends on h and the scene and not on S.

**Reach.** The arm breaks the planar symmetry. With a(rho) = P(reachable | rho), attempts that the arm reached follow
p(rho) a(rho). A moved hand that is not reachable is UNREACHABLE, whatever it was. A reachable one whose attempt was not
has an unknown outcome and gets weight 0; the others make up for it by the factor 1 / a(rho), for which the number of
draws from p(p_O | rho) until one is reachable is an unbiased estimate (geometric law).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from bayesgrasp.data.schema import AttemptRecords, HandRecords
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.prior.planar_symmetry import PlanarRefresh, moved, to_object
from bayesgrasp.types import Outcome


@dataclass(frozen=True)
class PairingConfig:
    """How hands are chosen for a scene.

    Attributes:
        hands: K, hands of each scene.
        success_share: Share of the places that go to successes.
        dropped_share: Share that goes to attempts that lost the object; the rest is for the other failures. Places
            that a class cannot fill go to the classes that can.
        tempering: 0 takes the attempts of a class as they were drawn, 1 as the prior would draw them.

    Raises:
        InvalidConfigurationError: A value outside its range.
    """

    hands: int = 32
    success_share: float = 0.4
    dropped_share: float = 0.3
    tempering: float = 0.5

    def __post_init__(self) -> None:
        if self.hands < 1:
            raise InvalidConfigurationError(f"a scene needs at least one hand, got {self.hands}")
        if min(self.success_share, self.dropped_share) < 0 or self.success_share + self.dropped_share > 1:
            raise InvalidConfigurationError("success_share and dropped_share must be >= 0 and sum to at most 1")
        if not 0 <= self.tempering <= 1:
            raise InvalidConfigurationError(f"tempering must be in [0, 1], got {self.tempering}")


class DrawPairing:
    """Chooses hands for the scenes of one object draw.

    Args:
        attempts: All attempts of the draw.
        refresh: The planar symmetry, with the arm's reach.
        config: See `PairingConfig`.
    """

    def __init__(self, attempts: AttemptRecords, refresh: PlanarRefresh, config: PairingConfig) -> None:
        self.attempts, self.refresh, self.config = attempts, refresh, config
        self.relative = to_object(attempts)
        log_marginal = refresh.log_marginal(self.relative)
        # A hand in a corner of the box that the nodes of p(rho) all miss stands for nothing that can be weighed.
        self.certain = np.isfinite(log_marginal)
        self.log_base = attempts.log_weight - np.where(self.certain, log_marginal, 0.0)
        success, dropped = attempts.outcome == Outcome.SUCCESS, attempts.outcome == Outcome.DROPPED
        self.classes = (success, dropped, ~(success | dropped))
        self.trials = np.zeros(len(attempts), np.int64)  # draws until reachable, of the attempts that were asked

    def choose(self, object_pose: Float64[np.ndarray, "3"], rng: np.random.Generator) -> HandRecords:
        """K hands for a scene of this draw, in random order, padded where there are too few; shape (1, K)."""
        there = moved(self.attempts, self.relative, np.tile(object_pose, (len(self.attempts), 1)))
        # log omega = log w + log p(h') - log p(rho).
        omega = np.where(self.certain, np.exp(self.log_base + self.refresh.log_density(there)), 0.0)
        value = np.where(omega > 0, omega**self.config.tempering, 0.0)
        taken, probability = self._select(value, rng)
        hands = AttemptRecords(**there[taken].columns())
        weight = omega[taken] / probability / len(omega) * np.exp(hands.object_log_weight)
        selection = value[taken] / probability / max(value.sum(), 1e-300)
        outcome, certain, factor = self._reach(hands, taken, rng)
        hands = replace(hands, outcome=outcome, held=hands.held * (outcome == Outcome.SUCCESS))
        return _pad(hands, taken, weight * certain * factor, selection * certain, self.config.hands)

    def _select(
        self, value: Float64[np.ndarray, "a"], rng: np.random.Generator
    ) -> tuple[Int64[np.ndarray, "k"], Float64[np.ndarray, "k"]]:
        """Attempts to take, shuffled, and the probability with which each was taken."""
        members = [np.flatnonzero(kind & (value > 0)) for kind in self.classes]
        places = self._places([len(m) for m in members])
        inclusion = np.zeros(len(value))
        chosen = []
        for member, count in zip(members, places, strict=True):
            inclusion[member] = inclusion_probabilities(value[member], count)
            chosen.append(member[systematic(inclusion[member], rng)])
        taken = rng.permutation(np.concatenate(chosen))
        return taken, inclusion[taken]

    def _places(self, available: list[int]) -> list[int]:
        """Places of each class: its share, and what the others leave."""
        total, config = self.config.hands, self.config
        wanted = [round(total * config.success_share), round(total * config.dropped_share)]
        places = [min(w, a) for w, a in zip(wanted, available, strict=False)]
        places.append(min(total - sum(places), available[2]))
        for index in (0, 1):
            places[index] += min(total - sum(places), available[index] - places[index])
        return places

    def _reach(
        self, hands: AttemptRecords, taken: Int64[np.ndarray, "k"], rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Outcome in the scene, whether it is known, and the factor 1 / a(rho) or its estimate."""
        known = hands.outcome != Outcome.UNREACHABLE
        if self.refresh.reachable is None:
            return hands.outcome, np.ones(len(hands)), np.ones(len(hands))
        reached = self.refresh.reachable(hands)
        outcome = np.where(reached, hands.outcome, np.uint8(Outcome.UNREACHABLE))
        self._count_trials(taken[reached & known], rng)
        factor = np.where(reached & known, self.trials[taken], 1)
        return outcome, (~reached | known).astype(np.float64), factor

    def _count_trials(self, rows: Int64[np.ndarray, "m"], rng: np.random.Generator) -> None:
        """Draw the numbers for the attempts that have none yet; scenes of the draw share them."""
        new = rows[self.trials[rows] == 0]
        if len(new):
            _, self.trials[new] = self.refresh.redraw(self.attempts[new], np.ones(len(new), bool), rng)


def inclusion_probabilities(value: Float64[np.ndarray, "n"], count: int) -> Float64[np.ndarray, "n"]:
    """min(1, c v_j) with c such that they sum to ``count``.

    Values whose share of the places would exceed one are taken for certain, and the others share the places that are
    left; that raises their c, so it is repeated until none exceeds one.
    """
    if count >= len(value):
        return np.ones(len(value))
    certain = np.zeros(len(value), dtype=bool)
    while True:
        scale = (count - certain.sum()) / value[~certain].sum()
        probability = np.where(certain, 1.0, value * scale)
        if (probability <= 1).all():
            return probability
        certain |= probability > 1


def systematic(probability: Float64[np.ndarray, "n"], rng: np.random.Generator) -> Int64[np.ndarray, "k"]:
    """Indices taken with the given probabilities, as many as they sum to, none twice."""
    # Lengths pi_j laid end to end, in random order, meet the comb start, start + 1, ... in as many points as they sum
    # to; a length of at most one meets at most one, with the probability pi_j. Rounding must not lose the last point.
    order = rng.permutation(len(probability))
    cumulative = np.cumsum(probability[order])
    start = rng.random()
    below = np.floor(np.concatenate([[0.0], cumulative]) - start + 1e-9)
    return np.sort(order[np.diff(below) > 0])


def _pad(
    hands: AttemptRecords,
    source: Int64[np.ndarray, "k"],
    weight: Float64[np.ndarray, "k"],
    selection: Float64[np.ndarray, "k"],
    total: int,
) -> HandRecords:
    missing = total - len(hands)
    columns = {name: hands.columns()[name] for name in HandRecords.__dataclass_fields__ if name in hands.columns()}
    columns |= {
        "weight": (total * weight).astype(np.float32),
        "selection_weight": (total * selection).astype(np.float32),
        "source": source.astype(np.int32),
    }
    padded = {name: _extend(column, missing) for name, column in columns.items()}
    padded["source"][total - missing :] = -1
    return HandRecords(**{name: column[None] for name, column in padded.items()})


def _extend(column: np.ndarray, missing: int) -> np.ndarray:
    """Zeros at the end, the weights among them."""
    return np.concatenate([column, np.zeros((missing, *column.shape[1:]), column.dtype)])
