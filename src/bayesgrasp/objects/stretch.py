"""Stretched copies of objects: more shapes to learn from than there are scans.

A copy is the object under diag(f_x, f_y, f_z): it still rests on z = 0 with its centre of mass above the origin, convex
parts stay convex, and its mass grows with its volume. Unlike the scale beta it has other proportions, so a model that
practises on copies meets shapes that no scan has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.meshes.convex import ConvexPart
from bayesgrasp.meshes.mass import mass_properties
from bayesgrasp.objects.object_asset import ObjectAsset


@dataclass(frozen=True)
class StretchConfig:
    """How copies differ.

    Attributes:
        copies: Of each object.
        most: Each axis is multiplied by a factor between 1 / most and most, uniform in its logarithm.

    Raises:
        InvalidConfigurationError: A negative number of copies, or a factor below 1.
    """

    copies: int = 0
    most: float = 1.3

    def __post_init__(self) -> None:
        if self.copies < 0 or not 1 <= self.most < np.inf:
            raise InvalidConfigurationError(f"need copies >= 0 and a finite most >= 1, got {self}")


def stretched(asset: ObjectAsset, factors: Float64[np.ndarray, "3"], name: str) -> ObjectAsset:
    """The object with its axes multiplied by positive factors.

    Args:
        asset: In the object frame.
        factors: Of x, y and z.
        name: Id of the copy.

    Raises:
        InvalidConfigurationError: A factor is not positive and finite.
    """
    if not (np.isfinite(factors).all() and (factors > 0).all()):
        raise InvalidConfigurationError(f"object '{asset.id}' cannot be stretched by {factors}: must be positive")
    parts = tuple(ConvexPart(part.vertices * factors, part.faces) for part in asset.parts)
    center, inertia = mass_properties(parts)
    return replace(
        asset,
        id=name,
        # One density: the determinant of diag(f) times the mass. Centre and inertia are those of the stretched parts.
        mass_kg=asset.mass_kg * float(np.prod(factors)),
        vertices=asset.vertices * factors,
        parts=parts,
        center_of_mass=center,
        inertia=inertia,
    )


def with_copies(
    objects: tuple[ObjectAsset, ...], config: StretchConfig, rng: np.random.Generator
) -> tuple[ObjectAsset, ...]:
    """The objects, in their order, and then their stretched copies, named ``id~1`` and so on."""
    reach = np.log(config.most)
    copies = [
        stretched(asset, np.exp(rng.uniform(-reach, reach, 3)), f"{asset.id}~{number}")
        for number in range(1, config.copies + 1)
        for asset in objects
    ]
    return (*objects, *copies)
