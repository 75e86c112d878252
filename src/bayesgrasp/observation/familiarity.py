"""Is this image like the training images? A misspecified simulator gives a confident and wrong posterior.

A dozen statistics of an image (what is missing, how flat and how noisy the table is, how large the object is and
where) are compared with their mean m and covariance C over simulated images by the Mahalanobis distance

    d^2 = (s - m)^T C^-1 (s - m).

An image is unfamiliar where d exceeds the distance that all but a stated share of simulated images keep. The
statistics stand in the model's card, since they belong to the simulator that trained it. They are summaries and not the
posterior's own view: a familiar image may still fool the network (Schmitt et al. 2021, Cannon et al. 2022).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import CheckpointError, InvalidConfigurationError, clipped, shown
from bayesgrasp.observation.surface import Surface, in_square

STATISTICS = (
    "valid_share",
    "valid_share_of_workspace",
    "table_offset",
    "table_residual",
    "roughness",
    "object_height",
    "object_middle_height",
    "object_pixels",
    "object_length",
    "object_width",
    "object_distance",
)
LARGEST_RATIO = 1e12
"""Of the scales of a whitening; with more, its inverse is rounding."""
WORKSPACE = 0.25
"""Half side of the square whose pixels count as the workspace, metres."""


def statistics(surface: Surface) -> Float64[np.ndarray, "11"]:
    """The `STATISTICS` of an image with an object in it (metres, shares, square roots of pixels)."""
    points, valid, item = surface.points, surface.valid, surface.item
    with np.errstate(invalid="ignore"):
        near = valid & in_square(points, WORKSPACE)
        table = near & (points[..., 2] < surface.config.table_thickness) & ~item
    height = points[table][:, 2] if table.any() else np.zeros(1)
    steps = np.diff(points[..., 2], axis=1)[table[:, 1:] & table[:, :-1]]
    middle = slice(valid.shape[0] // 4, -valid.shape[0] // 4), slice(valid.shape[1] // 4, -valid.shape[1] // 4)
    offset = np.median(height)
    scene = (
        valid.mean(),
        valid[middle].mean(),
        offset,
        np.median(np.abs(height - offset)),
        np.median(np.abs(steps)) if len(steps) else 0.0,
    )
    return np.array([*scene, *_item_statistics(surface)], dtype=np.float64)


def _item_statistics(surface: Surface) -> tuple[float, ...]:
    points = surface.item_points.astype(np.float64)
    if len(points) == 0:
        return (0.0,) * 6
    plane = points[:, :2] - points[:, :2].mean(0)
    spread = np.sqrt(np.clip(np.linalg.eigvalsh(plane.T @ plane / len(points)), 0, None))
    top, middle = np.percentile(points[:, 2], (98, 50))
    return top, middle, np.sqrt(len(points)), spread[1], spread[0], float(np.hypot(*surface.center))


@dataclass(frozen=True)
class Familiarity:
    """What simulated images look like.

    Attributes:
        mean: Of the statistics.
        whitening: W with W^T W = C^-1.
        threshold: Distance beyond which an image is called unfamiliar.
    """

    mean: Float64[np.ndarray, "k"]
    whitening: Float64[np.ndarray, "k k"]
    threshold: float

    def distance(self, surface: Surface) -> float:
        """Mahalanobis distance of an image from the simulated ones."""
        return float(np.linalg.norm(self.whitening @ (statistics(surface) - self.mean)))

    def strangest(self, surface: Surface) -> str:
        """The statistic that is farthest from its mean, in standard deviations, in words."""
        values = statistics(surface)
        deviation = np.sqrt(np.diag(np.linalg.inv(self.whitening.T @ self.whitening)))
        index = int(np.argmax(np.abs(values - self.mean) / deviation))
        low, high = self.mean[index] - 3 * deviation[index], self.mean[index] + 3 * deviation[index]
        name = STATISTICS[index].replace("_", " ")
        return f"{name} is {values[index]:.4g}, in training mostly {low:.4g} to {high:.4g}"

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for a model's card."""
        names = {"statistics": list(STATISTICS), "threshold": self.threshold}
        return names | {"mean": self.mean.tolist(), "whitening": self.whitening.tolist()}

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> Familiarity:
        """From the data of `to_dict`.

        Raises:
            CheckpointError: The data are of other statistics, or damaged.
        """
        try:
            if tuple(content["statistics"]) != STATISTICS:
                raise CheckpointError("the card's image statistics are of another version; train or fit them again")
            mean, whitening, threshold = (_numbers(content[key]) for key in ("mean", "whitening", "threshold"))
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise CheckpointError(f"the image statistics in the card cannot be read: {clipped(error)}") from error
        count = len(STATISTICS)
        shapes = mean.shape, whitening.shape, threshold.shape
        if shapes != ((count,), (count, count), ()) or not 0 < threshold < np.inf:
            raise CheckpointError(f"the image statistics in the card are not those of {count} numbers")
        # A whitening that cannot be undone measures no distance.
        if not (np.isfinite(mean).all() and np.isfinite(whitening).all() and np.linalg.cond(whitening) < LARGEST_RATIO):
            raise CheckpointError("the image statistics in the card are not finite, or do not tell images apart")
        return Familiarity(mean, whitening, float(threshold))


def _numbers(value: Any) -> Float64[np.ndarray, "..."]:
    """Nested lists of numbers as an array; NumPy alone would also take the text "1" for one."""
    array = np.array(value)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"not numbers: {shown(value)}")
    return array.astype(np.float64)


def fit_familiarity(surfaces: Iterable[Surface], false_alarms: float = 0.005) -> Familiarity:
    """Mean, covariance and threshold of the statistics over simulated images.

    Args:
        surfaces: At least 200 of them, with an object in view.
        false_alarms: Share of simulated images that may be called unfamiliar.

    Raises:
        InvalidConfigurationError: Too few images, or a share outside (0, 1).
    """
    values = np.stack([statistics(s) for s in surfaces])
    if len(values) < 200 or not 0 < false_alarms < 1:
        raise InvalidConfigurationError(f"need at least 200 images (got {len(values)}) and 0 < false_alarms < 1")
    mean, covariance = values.mean(0), np.cov(values.T)
    # A statistic that never varies in the simulator must not be divided by zero.
    covariance += np.diag(1e-4 * np.diag(covariance) + 1e-10)
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    distances = np.linalg.norm((values - mean) @ whitening.T, axis=1)
    return Familiarity(mean, whitening, float(np.quantile(distances, 1 - false_alarms)))
