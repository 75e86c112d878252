"""What plans delivered on objects that no training had met, and what may be promised because of it.

A network is surest about what it was trained on. So a model is judged by the grasps that its planner selects, one for
each of many fresh objects: what it promised, p = p(S=1 | i, h), and what the lift test delivered, S. From these pairs

    ln (q / (1 - q)) = a ln p - b ln (1 - p) + c,    a, b >= 0

gives the promise q that holds on fresh objects (beta calibration, Kull et al. 2017: it keeps the order of grasps), and
for a wanted success rate the least promise that a grasp must make. That one is found by testing a fixed sequence of
thresholds, the strictest first: the plans above a threshold pass if a binomial with the wanted rate would fail that
seldom only with a small probability (Learn then Test, Angelopoulos et al. 2021; the conditional form of conformal risk
control). One plan an object makes the pairs exchangeable with plans on further objects of the same distribution.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Float64
from scipy.optimize import minimize
from scipy.special import bdtr, expit

from bayesgrasp.errors import CheckpointError, InvalidConfigurationError, clipped

FEWEST = 100
"""Plans that a calibration needs."""
DOUBT = 0.1
"""Probability, over the plans of the calibration, that a threshold delivers less than was wanted."""
MARGIN = 2
"""Failures that the strictest threshold that is tested may have and still pass."""
SHARES = np.linspace(0.05, 1.0, 96)
"""Of the plans, by their promise, the best of which are tested; a fixed sequence."""
NEAREST = 1e-4
"""A promise is taken to be at least this far from 0 and from 1: networks saturate."""
PULL = 0.01
"""Weight, in plans, of the identity in the fit: decides where the plans do not."""


@dataclass(frozen=True)
class Delivery:
    """Plans on fresh objects.

    Attributes:
        promised: The model's p(S=1 | i, h) of every plan's grasp, before calibration.
        success: S of every grasp.
        objects: Where the objects came from, in words.
        weights: SHA-256 of the estimators that promised, in the order of their roles.

    Raises:
        InvalidConfigurationError: Fewer than `FEWEST` plans, or promises that are no probabilities.
    """

    promised: Float64[np.ndarray, "n"]
    success: Bool[np.ndarray, "n"]
    objects: str
    weights: tuple[str, ...]

    def __post_init__(self) -> None:
        if len(self.promised) < FEWEST or len(self.promised) != len(self.success):
            raise InvalidConfigurationError(
                f"a calibration needs at least {FEWEST} plans with their outcomes, got {len(self.promised)} promises "
                f"and {len(self.success)} outcomes"
            )
        if not ((self.promised >= 0) & (self.promised <= 1)).all():
            raise InvalidConfigurationError("promises must be probabilities between 0 and 1")

    def least_promise(self, wanted: float) -> float | None:
        """The least calibrated promise of a grasp that is to succeed at the wanted rate on fresh objects.

        Args:
            wanted: Success rate, between 0 and 1.

        Returns:
            None where no promise of this model was found to deliver that.

        Raises:
            InvalidConfigurationError: The rate is not between 0 and 1.
        """
        if not 0 < wanted < 1:
            raise InvalidConfigurationError(f"a confidence is between 0 and 1, got {wanted}")
        order = np.argsort(-self.promised, kind="stable")
        failures = np.cumsum(~self.success[order])
        least = None
        for count in np.ceil(SHARES * len(order)).astype(int):
            if bdtr(MARGIN, count, 1 - wanted) > DOUBT:  # scipy.stats would take half a second to import
                continue  # so few plans cannot show it, or only if hardly any of them failed
            if bdtr(failures[count - 1], count, 1 - wanted) > DOUBT:
                break
            least = self.promised[order[count - 1]]
        return None if least is None else float(self.calibration.of(np.array([least]))[0])

    @cached_property
    def calibration(self) -> BetaCalibration:
        """From the model's promises to such that hold on fresh objects."""
        return fit_beta(self.promised, self.success)

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for a model's card."""
        return {
            "objects": self.objects,
            "weights": list(self.weights),
            "promised": [round(value, 6) for value in self.promised.tolist()],
            "success": self.success.astype(int).tolist(),
        }

    @staticmethod
    def from_dict(content: Any) -> Delivery:
        """From the data of `to_dict`.

        Raises:
            CheckpointError: The data are damaged.
        """
        try:
            promised, success = _numbers(content, "promised"), _numbers(content, "success")
            objects, weights = content["objects"], tuple(content["weights"])
            if not np.isin(success, (0, 1)).all() or not all(isinstance(word, str) for word in (objects, *weights)):
                raise ValueError("outcomes are 0 or 1; objects and weights are texts")
            return Delivery(promised, success.astype(bool), objects, weights)
        except (KeyError, TypeError, ValueError, OverflowError, InvalidConfigurationError) as error:
            raise CheckpointError(f"what plans delivered cannot be read: {clipped(error)}") from error


@dataclass(frozen=True)
class BetaCalibration:
    """ln (q / (1 - q)) = a ln p - b ln (1 - p) + c.

    Attributes:
        a, b: At least 0, so that the order of promises stays.
        c: Any number.
    """

    a: float
    b: float
    c: float

    def of(self, promised: Float[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
        """The promises q that hold; NaN stays NaN."""
        return _value(np.array([self.a, self.b, self.c]), *_logarithms(promised))


def fit_beta(promised: Float[np.ndarray, "n"], success: Bool[np.ndarray, "n"]) -> BetaCalibration:
    """The calibration of highest likelihood, drawn to the identity by the weight of a hundredth of a plan."""
    logarithms, identity = _logarithms(promised), np.array([1.0, 1.0, 0.0])

    def loss(x: Float64[np.ndarray, "3"]) -> tuple[float, Float64[np.ndarray, "3"]]:
        q = _value(x, *logarithms).clip(1e-12, 1 - 1e-12)
        deviance = -np.where(success, np.log(q), np.log1p(-q)).sum()
        slope = np.stack([*logarithms, np.ones_like(q)]) @ (q - success)
        return float(deviance + PULL * ((x - identity) ** 2).sum()), slope + 2 * PULL * (x - identity)

    found = minimize(loss, identity, jac=True, method="L-BFGS-B", bounds=[(0, None), (0, None), (None, None)])
    return BetaCalibration(*map(float, found.x))


def _logarithms(promised: Float[np.ndarray, "n"]) -> tuple[Float64[np.ndarray, "n"], Float64[np.ndarray, "n"]]:
    p = np.clip(np.asarray(promised, dtype=np.float64), NEAREST, 1 - NEAREST)
    return np.log(p), -np.log1p(-p)


def _value(
    x: Float64[np.ndarray, "3"], first: Float64[np.ndarray, "n"], second: Float64[np.ndarray, "n"]
) -> Float64[np.ndarray, "n"]:
    promise: Float64[np.ndarray, "n"] = expit(x[0] * first + x[1] * second + x[2])
    return promise


def _numbers(content: Mapping[str, Any], name: str) -> Float64[np.ndarray, "n"]:
    values = np.array(content[name])
    if values.ndim != 1 or values.dtype.kind not in "iuf":
        raise TypeError(f"{name} must be a list of numbers")
    return values.astype(np.float64)
