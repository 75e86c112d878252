r"""Where to try: the prior, or a mixture of the prior and the neighbourhoods of earlier successes.

Under the prior most attempts meet nothing, and hard objects hardly ever succeed. In rounds, the successes of all
earlier rounds become kernels in the frame of their object, and a hand for O at p_O is drawn from the defensive mixture

    q(h | O, p_O) = eps p(h) + (1 - eps) k(h | O, p_O),
    k = \sum_j a_j N(x; x_j(p_O), sigma^2) PS(R; R_j(p_O), kappa) T(g | g_j)  /  \sum_j a_j Z_j(p_O),

where a_j is the importance weight of success j, x_j(p_O) and R_j(p_O) its pose carried to p_O, N is cut off at the
prior's box and Z_j(p_O) is the share of the uncut kernel inside it (three differences of error functions), PS is the
antipodally symmetric power-spherical law, and T keeps the grasp type with probability 1 - delta. The density is exact,
so is the weight p(h) / q(h), and the weight is at most 1 / eps. The choice of objects is a defensive mixture too: half
uniform, half leaning to objects that succeed rarely, so p(O) / q(O) is at most 2.

An object with few successes borrows from attempts that held it for a moment (DROPPED): any kernels give an exact law.
Every kernel of a success is a draw from p(rho | S = 1, O), and each new pose p_O uses it: the planar symmetry at work.
The rounds are fixed ranges of chunk numbers and read complete earlier rounds only, so that a chunk's content depends
on the seed and its number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64, UInt8
from scipy import special

from bayesgrasp.data.schema import AttemptRecords
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3
from bayesgrasp.geometry.hand_arrays import hands_of
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.prior.planar_symmetry import RelativeHands, to_object, to_world
from bayesgrasp.prior.power_spherical import PowerSpherical, log_even_power, log_normalizer
from bayesgrasp.types import Attempts, Outcome

NOTHING = 1e-9
"""Share of the kernels inside the box below which a pose is given to the prior."""


@dataclass(frozen=True)
class AdaptiveConfig:
    """The adaptive proposal; see the module.

    Attributes:
        prior_share: eps, the share of hands drawn from the prior.
        position_deviation: sigma, metres.
        kappa: Concentration of the rotation kernel; its deviation is about sqrt(8 / kappa) rad about each axis.
        type_change: delta, the probability of a grasp type drawn anew.
        max_kernels: Successes kept for each object.
        enough: Successes of an object below which attempts that dropped it become kernels too; see `learn`.
        first_round: Chunks of round 0, which is all prior. Round r ends at chunk ``first_round * 2**r``.
        rounds: After so many rounds the proposal stays as it is.

    Raises:
        InvalidConfigurationError: A value outside its range.
    """

    prior_share: float = 0.5
    position_deviation: float = 0.02
    kappa: float = 150.0
    type_change: float = 0.2
    max_kernels: int = 256
    enough: int = 32
    first_round: int = 16
    rounds: int = 6

    def __post_init__(self) -> None:
        if not 0 < self.prior_share < 1:
            raise InvalidConfigurationError(f"prior_share must be in (0, 1), got {self.prior_share}")
        if not (0 < self.position_deviation < math.inf and 0 < self.kappa < math.inf):
            raise InvalidConfigurationError(
                f"position_deviation and kappa must be positive, got {self.position_deviation} and {self.kappa}"
            )
        if not 0 < self.type_change <= 1:
            raise InvalidConfigurationError(f"type_change must be in (0, 1], got {self.type_change}")
        if min(self.max_kernels, self.enough, self.first_round, self.rounds) < 1:
            raise InvalidConfigurationError("max_kernels, enough, first_round and rounds must be at least 1")

    def round_of(self, chunk: int) -> int:
        """The round that a chunk belongs to."""
        return min((chunk // self.first_round).bit_length(), self.rounds)

    def round_start(self, number: int) -> int:
        """The first chunk of a round, which reads all chunks before it."""
        return 0 if number == 0 else self.first_round * 2 ** (number - 1)


@dataclass(frozen=True)
class Kernels:
    """Earlier successes of one object.

    Attributes:
        hands: Their poses in the object frame.
        share: a_j, summing to 1.
    """

    hands: RelativeHands
    share: Float64[np.ndarray, "n"]


@dataclass(frozen=True)
class Proposal:
    """q(O) and q(h | O, p_O) of one round.

    Attributes:
        objects: q(O).
        kernels: For each object; None where it never succeeded, which means the prior alone.
    """

    objects: Float64[np.ndarray, "objects"]
    kernels: tuple[Kernels | None, ...]

    @staticmethod
    def prior(num_objects: int) -> Proposal:
        """The prior itself."""
        return Proposal(np.full(num_objects, 1 / num_objects), (None,) * num_objects)


def learn(records: AttemptRecords, num_objects: int, config: AdaptiveConfig, rng: np.random.Generator) -> Proposal:
    """The proposal for the next round.

    Args:
        records: Attempts of all earlier rounds, of any outcome.
        num_objects: Size of the object set.
        config: See `AdaptiveConfig`.
        rng: Chooses the kernels where there are more than enough.
    """
    success = records.outcome == Outcome.SUCCESS
    weight = np.exp(records.log_weight.astype(np.float64))
    tried = np.bincount(records.object_index, weight, num_objects)
    rate = np.bincount(records.object_index, weight * success, num_objects) / np.maximum(tried, 1.0)
    # n attempts with rate r give a relative error of about (n r)^(-1/2); the sum of its squares over all objects is
    # least where n goes with r^(-1/2). An object that never succeeded counts as if it had, once.
    floor = 1.0 / np.maximum(tried, 1.0)
    need = np.maximum(rate, floor) ** -0.5
    objects = 0.5 / num_objects + 0.5 * need / need.sum()
    kernels = tuple(_kernels(records[records.object_index == index], config, rng) for index in range(num_objects))
    return Proposal(objects, kernels)


def _kernels(records: AttemptRecords, config: AdaptiveConfig, rng: np.random.Generator) -> Kernels | None:
    """Kernels of one object: its successes, and while these are few, attempts that lost it, up to half of the share."""
    success = _thinned(records[records.outcome == Outcome.SUCCESS], config.max_kernels, rng)
    dropped = _thinned(records[records.outcome == Outcome.DROPPED], config.enough, rng)
    lacking = max(0.0, 1 - len(success) / config.enough) * len(dropped)
    parts = [part for part, use in ((success, len(success)), (dropped, lacking)) if use > 0]
    if not parts:
        return None
    # Successes together are trusted by 1 and drops by 1 - successes / enough, so drops have half of the share at most.
    trust = np.array([1.0, lacking / max(len(dropped), 1)])[: len(parts)] if len(success) else np.ones(1)
    shares = [_normalised(part) * t / trust.sum() for part, t in zip(parts, trust, strict=True)]
    return Kernels(to_object(AttemptRecords.cat(parts)), np.concatenate(shares))


def _thinned(records: AttemptRecords, most: int, rng: np.random.Generator) -> AttemptRecords:
    """At most so many records, chosen by their weight and then alike in it."""
    if len(records) <= most:
        return records
    chosen = np.sort(rng.choice(len(records), most, replace=False, p=_normalised(records)))
    return replace(records[chosen], log_weight=np.zeros(most, np.float32))


def _normalised(records: AttemptRecords) -> Float64[np.ndarray, "n"]:
    weight = np.exp(records.log_weight.astype(np.float64))
    shares: Float64[np.ndarray, "n"] = weight / weight.sum()
    return shares


def propose(
    attempts: Attempts, kernels: Kernels | None, prior: GraspPrior, config: AdaptiveConfig, rng: np.random.Generator
) -> tuple[Attempts, Float64[np.ndarray, "n"]]:
    """Draw the hands of attempts on one object anew.

    Args:
        attempts: Attempts with hands from the prior; all on the object of ``kernels``.
        kernels: Of that object.
        prior: p(h).
        config: See `AdaptiveConfig`.
        rng: Where the hands come from.

    Returns:
        The attempts with their new hands, and log p(h) - log q(h | O, p_O) of each.
    """
    if kernels is None:
        return attempts, np.zeros(len(attempts))
    inside = _Inside(kernels, attempts.object_pose, prior, config)
    drawn = inside.sample(rng)
    keep = (rng.random(len(attempts)) < config.prior_share) | inside.empty
    attempts = replace(
        attempts,
        position=np.where(keep[:, None], attempts.position, drawn.position.astype(np.float32)),
        quaternion=np.where(keep[:, None], attempts.quaternion, drawn.quaternion.astype(np.float32)),
        grasp_type=np.where(keep, attempts.grasp_type, drawn.grasp_type),
    )
    log_ratio = inside.log_density(attempts) - prior.log_prob(hands_of(attempts).to(dtype=torch.float64)).numpy()
    # q / p = eps + (1 - eps) k / p, by logarithms.
    mixed = np.logaddexp(math.log(config.prior_share), math.log1p(-config.prior_share) + log_ratio)
    return attempts, np.where(inside.empty, 0.0, -mixed)


class _Inside:
    """The kernel mixture k(h | O, p_O), cut off at the prior's box, for n poses of the object."""

    def __init__(
        self, kernels: Kernels, object_pose: Float[np.ndarray, "n 3"], prior: GraspPrior, config: AdaptiveConfig
    ) -> None:
        self.kernels, self.pose, self.prior, self.config = kernels, object_pose, prior, config
        n, m = len(object_pose), len(kernels.share)
        spread = kernels.hands[np.tile(np.arange(m), n)]
        centre, _ = to_world(spread, np.repeat(object_pose, m, axis=0))
        self.centre = centre.reshape(n, m, 3)
        # A normal law cut off at [low, high] has the mass F(high) - F(low) there, F its distribution function.
        sigma = config.position_deviation
        self.low = special.ndtr((np.array(prior.low) - self.centre) / sigma)
        self.high = special.ndtr((np.array(prior.high) - self.centre) / sigma)
        self.mass = kernels.share * np.prod(self.high - self.low, axis=-1)
        # A pose that carries every kernel far outside the box leaves nothing to draw from; there q is the prior.
        self.empty = self.mass.sum(axis=1) < NOTHING

    def sample(self, rng: np.random.Generator) -> RelativeHands:
        """One hand for each pose, in the world frame, inside the box after rounding to float32."""
        n = len(self.pose)
        # Kernel j with the probability mass_j / sum: how many partial sums lie below a uniform share of the whole.
        total = np.cumsum(self.mass, axis=1)
        chosen = (rng.random((n, 1)) * total[:, -1:] > total).sum(axis=1)
        rows = np.arange(n)
        # The inverse of F at a level that is uniform between F(low) and F(high) is a draw from the cut-off normal law.
        level = self.low[rows, chosen] + rng.random((n, 3)) * (self.high - self.low)[rows, chosen]
        step = special.ndtri(np.clip(level, 1e-300, 1 - 1e-16))
        position = self.centre[rows, chosen] + self.config.position_deviation * step
        low = np.nextafter(np.array(self.prior.low, np.float32), np.float32(np.inf))
        high = np.nextafter(np.array(self.prior.high, np.float32), np.float32(-np.inf))
        _, mode = to_world(self.kernels.hands[chosen], self.pose)
        return RelativeHands(
            np.clip(position, low, high), _compose(mode, self._small_turns(n, rng)), self._types(chosen, rng)
        )

    def log_density(self, attempts: Attempts) -> Float64[np.ndarray, "n"]:
        """Log k(h | O, p_O) with respect to the measure of p(h), for hands inside the box."""
        sigma, kappa = self.config.position_deviation, self.config.kappa
        # Carrying both to p_O keeps distances and angles, so hands and kernels are compared in the frame of the object.
        hands = to_object(attempts)
        distance = ((hands.position[:, None] - self.kernels.hands.position) ** 2).sum(-1)
        cosine = hands.quaternion @ self.kernels.hands.quaternion.T
        same = hands.grasp_type[:, None] == self.kernels.hands.grasp_type
        types = len(self.prior.types)
        log_type = np.log((1 - self.config.type_change) * same + self.config.type_change / types)
        log_rotation = log_even_power(torch.from_numpy(cosine**2), kappa).numpy() + log_normalizer(kappa, 4)
        log_position = -0.5 * distance / sigma**2 - 3 * math.log(sigma * math.sqrt(2 * math.pi))
        logs = np.log(self.kernels.share) + log_position + log_rotation + log_type
        log_k: Float64[np.ndarray, "n"] = special.logsumexp(logs, axis=1) - np.log(
            np.maximum(self.mass.sum(axis=1), NOTHING)
        )
        return log_k

    def _small_turns(self, n: int, rng: np.random.Generator) -> Float64[np.ndarray, "n 4"]:
        return PowerSpherical(np.array([1.0, 0.0, 0.0, 0.0]), self.config.kappa).sample(n, rng)

    def _types(self, chosen: Int64[np.ndarray, "n"], rng: np.random.Generator) -> UInt8[np.ndarray, "n"]:
        anew = np.array(self.prior.types, np.uint8)[rng.integers(len(self.prior.types), size=len(chosen))]
        change = rng.random(len(chosen)) < self.config.type_change
        return np.where(change, anew, self.kernels.hands.grasp_type[chosen])


def _compose(left: Float64[np.ndarray, "n 4"], right: Float64[np.ndarray, "n 4"]) -> Float64[np.ndarray, "n 4"]:
    """The quaternion of R(left) R(right)."""
    product = so3.quaternion_to_matrix(torch.from_numpy(left)) @ so3.quaternion_to_matrix(torch.from_numpy(right))
    return so3.matrix_to_quaternion(product).numpy()
