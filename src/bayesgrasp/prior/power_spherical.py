"""Power-spherical distributions, and their antipodally symmetric mixture on SO(3) (paper, section 2).

De Cao & Aziz (2020), on the unit sphere S^(d-1), with respect to its surface measure:

    p(q; mu, kappa) = C(kappa) (1 + mu . q)^kappa,
    1 / C(kappa) = 2^(a + b) pi^b Gamma(a) / Gamma(a + b),    a = (d - 1) / 2 + kappa,   b = (d - 1) / 2.

A mode of the rotation prior is the mean of the two with +mu and -mu on S^3. With c = |mu . q|, and M the rotation of
mu, c^2 = (1 + trace(M^T R)) / 4, so the density is a function of the matrix:

    p(R; M, kappa) = C(kappa) ((1 + c)^kappa + (1 - c)^kappa) / 2.

It is even, hence analytic in c^2: no choice of a quaternion's sign, no branch, a gradient everywhere. It has no zero
either: its least value, where trace R^T M = -1, is C(kappa). Densities of rotations are with respect to the surface
measure of S^3 (total 2 pi^2, both q and -q counted), as the paper's p(q); a uniform rotation has 1 / (2 pi^2).
"""

from __future__ import annotations

import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry import so3

LOG_UNIFORM_ROTATION = -math.log(2 * math.pi**2)
"""Log density of a uniform rotation with respect to the surface measure of S^3."""

FLOOR = 1e-4
"""Where 1 + mu . q is about this or less (within 0.014 rad of the antipode), `log_prob` is floored smoothly."""


def check_concentration(kappa: float) -> None:
    """Refuse a concentration that is not a positive number.

    Raises:
        InvalidConfigurationError: kappa is zero, negative, infinite or not a number.
    """
    if not (math.isfinite(kappa) and kappa > 0):
        raise InvalidConfigurationError(f"kappa must be a finite number > 0 (the paper: 30), got {kappa}")


def log_normalizer(kappa: float, dimension: int) -> float:
    """Logarithm of C(kappa) on the sphere in R^dimension."""
    b = (dimension - 1) / 2
    a = b + kappa
    return math.lgamma(a + b) - math.lgamma(a) - (a + b) * math.log(2) - b * math.log(math.pi)


class PowerSpherical:
    """One power-spherical distribution on S^(d-1).

    Args:
        mean: The mode mu, of unit length, shape (d,), d >= 2.
        kappa: Concentration, > 0.

    Raises:
        InvalidConfigurationError: kappa is not positive, or the mean is not a unit vector.
    """

    def __init__(self, mean: Float[np.ndarray, "d"], kappa: float) -> None:
        check_concentration(kappa)
        if len(mean) < 2 or not abs(float(np.linalg.norm(mean)) - 1.0) < 1e-5:
            raise InvalidConfigurationError(
                f"the mean must be a vector of unit length in two or more dimensions, got {mean}"
            )
        self.mean = mean / np.linalg.norm(mean)
        self.kappa = kappa

    def sample(self, n: int, rng: np.random.Generator) -> Float[np.ndarray, "{n} d"]:
        """Draws of shape (n, d): mu . q from a beta law, the rest uniform around mu, by one reflection."""
        d = len(self.mean)
        cosine = 2 * rng.beta((d - 1) / 2 + self.kappa, (d - 1) / 2, n) - 1
        around = rng.standard_normal((n, d - 1))
        around /= np.linalg.norm(around, axis=-1, keepdims=True)
        draws = np.concatenate([cosine[:, None], np.sqrt(1 - cosine**2)[:, None] * around], axis=-1)
        # The Householder reflection that swaps the first axis with mu; none is needed where they coincide.
        normal = np.eye(d)[0] - self.mean
        length = np.linalg.norm(normal)
        if length < 1e-12:
            return draws
        normal /= length
        reflected: Float[np.ndarray, "{n} d"] = draws - 2 * (draws @ normal)[:, None] * normal
        return reflected

    def log_prob(self, q: Float[Tensor, "*batch d"]) -> Float[Tensor, "*batch"]:
        """Log density with respect to the surface measure, for unit vectors.

        The density is 0 at the antipode. There u = 1 + mu . q is replaced by (u + sqrt(u^2 + 4 FLOOR^2)) / 2, which
        is smooth and positive, moves the log density by less than kappa (FLOOR / u)^2, and keeps it and its gradient
        finite in float32.
        """
        mean = torch.as_tensor(self.mean, dtype=q.dtype, device=q.device)
        u = 1 + (q * mean).sum(-1)
        root = (u.square() + 4 * FLOOR**2).sqrt()
        positive = torch.where(u >= 0, 0.5 * (root + u), 2 * FLOOR**2 / (root - u.clamp(max=0)))
        return log_normalizer(self.kappa, len(self.mean)) + self.kappa * positive.log()


class RotationMixture:
    """Equal mixture of antipodally symmetric power-spherical modes, as a density of rotation matrices.

    Args:
        modes: Rotations of the modes, shape (m, 3, 3).
        kappa: Their common concentration, > 0.

    Raises:
        InvalidConfigurationError: kappa is not positive.
    """

    def __init__(self, modes: Float[Tensor, "m 3 3"], kappa: float) -> None:
        check_concentration(kappa)
        self.modes = modes.to(torch.float64)
        self.kappa = kappa

    def sample(self, n: int, rng: np.random.Generator) -> Float[Tensor, "{n} 3 3"]:
        """Rotations, float64. A draw about the identity is carried to its mode by the group, which keeps the measure.

        The sign of q, on which the mixture is symmetric, is lost in the matrix and is not drawn.
        """
        mode = torch.from_numpy(rng.integers(len(self.modes), size=n))
        around = PowerSpherical(np.array([1.0, 0.0, 0.0, 0.0]), self.kappa).sample(n, rng)
        return self.modes[mode] @ so3.quaternion_to_matrix(torch.from_numpy(around))

    def log_prob(self, rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch"]:
        """Log density with respect to the surface measure of S^3; finite and differentiable for every rotation."""
        modes = self.modes.to(dtype=rotation.dtype, device=rotation.device)
        trace = rotation.flatten(-2) @ modes.flatten(-2).mT
        logs = log_even_power((1 + trace) / 4, self.kappa)
        return log_normalizer(self.kappa, 4) + torch.logsumexp(logs, -1) - math.log(len(modes))


def log_even_power(squared: Float[Tensor, "*batch"], kappa: float) -> Float[Tensor, "*batch"]:
    """Logarithm of ((1 + c)^kappa + (1 - c)^kappa) / 2 as a smooth function of c^2 in [0, 1].

    It equals kappa log(1 + c) + softplus(-2 kappa artanh c) - log 2. The square root has no derivative at 0, so c^2 is
    moved by one machine epsilon, which changes the result by at most kappa^2 epsilon / 2. Rounding may take c^2 out
    of [0, 1]: below, the function goes on along its tangent; above, the vanishing second term is held (for kappa < 2,
    whose mode is a kink, the gradient at the mode itself leaves that term out).
    """
    epsilon = torch.finfo(squared.dtype).eps
    c = (squared.clamp(min=0) + epsilon).sqrt()
    other = -2 * kappa * torch.atanh(c.clamp(max=1 - 2 * epsilon))
    below = -0.5 * kappa * (kappa - 1) * torch.relu(-squared)
    return kappa * torch.log1p(c) + torch.nn.functional.softplus(other) - math.log(2) + below


def downward_modes() -> Float[Tensor, "4 3 3"]:
    """The four rotations of the paper: hand x (approach) along world -z, turned by quarter turns about world z."""
    down = torch.tensor([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]], dtype=torch.float64)
    quarters = torch.arange(4, dtype=torch.float64) * (math.pi / 2)
    axis = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    return so3.exp(quarters[:, None] * axis) @ down
