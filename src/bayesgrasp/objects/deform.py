r"""Deformed copies of objects: more shapes to learn from than there are scans.

A copy is bent, tapered and stretched, in this order, in the object frame. With H its height, and R = l / a for an arc
of a radians over the length l of its longer horizontal side,

    bend      (x, y) -> (R - y) (sin x / R, -cos x / R) + (0, R)
    taper     (x, y) -> (1 + t (1/2 - z / H)) (x, y)
    stretch   p -> diag(f) p

Heights do not change before the stretch, so the face that an object rests on stays flat; a copy that was bent or
tapered settles anew (`meshes.resting`). Convex parts become the hulls of their mapped corners. That is the mapped
part for a stretch and nearly so for gentle bends; where it is not, because a part is long or the mesh has details
between corners, bend and taper are halved until parts and mesh agree to `AGREEMENT`: a copy bends as its parts allow.
Mass grows with the parts' volume. Unlike the scale beta a copy has other proportions, so a model that practises on
copies meets shapes that no scan has; p(O) is then uniform over objects and copies, and no longer over the objects
alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.meshes.convex import ConvexPart, hull_part
from bayesgrasp.meshes.mass import mass_properties
from bayesgrasp.meshes.mesh import signed_volume
from bayesgrasp.meshes.resting import rest
from bayesgrasp.objects.object_asset import ObjectAsset

AGREEMENT = 0.0015
"""Metres by which a mapped corner of the mesh may lie farther outside the parts than it did before."""
HALVINGS = 3
"""After so many a copy is stretched only."""


@dataclass(frozen=True)
class DeformConfig:
    """How copies differ.

    Attributes:
        copies: Of each object.
        stretch: Each axis is multiplied by a factor between 1 / stretch and stretch, uniform in its logarithm.
        taper: Widths change by up to this share between bottom and top, either way.
        bend: The longer horizontal side becomes an arc of up to so many radians, either way.

    Raises:
        InvalidConfigurationError: A negative number of copies, a factor below 1, a taper that leaves no top, or a bend
            of more than half a turn.
    """

    copies: int = 0
    stretch: float = 1.3
    taper: float = 0.0
    bend: float = 0.0

    def __post_init__(self) -> None:
        if self.copies < 0 or not 1 <= self.stretch < np.inf:
            raise InvalidConfigurationError(f"need copies >= 0 and a finite stretch >= 1, got {self}")
        if not (0 <= self.taper < 1 and 0 <= self.bend < np.pi):
            raise InvalidConfigurationError(f"need 0 <= taper < 1 and 0 <= bend < pi, got {self}")


@dataclass(frozen=True)
class Deformation:
    """One deformation; see the module's docstring.

    Attributes:
        factors: f, of x, y and z.
        taper: t.
        bend: a, radians.

    Raises:
        InvalidConfigurationError: A factor is not positive and finite.
    """

    factors: Float64[np.ndarray, "3"]
    taper: float = 0.0
    bend: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.factors).all() and (self.factors > 0).all()):
            raise InvalidConfigurationError(f"an object cannot be stretched by {self.factors}: must be positive")

    @property
    def is_stretch(self) -> bool:
        """Whether it is nothing but a stretch."""
        return self.taper == 0 and self.bend == 0

    def apply(self, points: Float64[np.ndarray, "n 3"], size: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "n 3"]:
        """Points of an object with such a bounding box."""
        bent = _bent(points, size, self.bend) if self.bend else points
        widths = 1 + self.taper * (0.5 - bent[:, 2:] / size[2])
        tapered = np.concatenate([widths * bent[:, :2], bent[:, 2:]], axis=1) if self.taper else bent
        mapped: Float64[np.ndarray, "n 3"] = tapered * self.factors
        return mapped

    def gentler(self) -> Deformation:
        """The same stretch with half the taper and bend."""
        return replace(self, taper=self.taper / 2, bend=self.bend / 2)


def deformed(asset: ObjectAsset, deformation: Deformation, name: str) -> ObjectAsset:
    """The object under a deformation, or under as much of it as its parts allow.

    Args:
        asset: In the object frame.
        deformation: What is done to it.
        name: Id of the copy.
    """
    for _ in range(HALVINGS):
        if deformation.is_stretch:
            break
        parts = _mapped_parts(asset, deformation)
        vertices = deformation.apply(asset.vertices, asset.extents)
        if _outside(parts, vertices) <= _outside(asset.parts, asset.vertices) + AGREEMENT:
            return _at_rest(asset, parts, vertices, name)
        deformation = deformation.gentler()
    return _stretched(asset, deformation.factors, name)


def with_copies(
    objects: tuple[ObjectAsset, ...], config: DeformConfig, rng: np.random.Generator
) -> tuple[ObjectAsset, ...]:
    """The objects, in their order, and then their deformed copies, named ``id~1`` and so on."""
    copies = [
        deformed(asset, _drawn(config, rng), f"{asset.id}~{number}")
        for number in range(1, config.copies + 1)
        for asset in objects
    ]
    return (*objects, *copies)


def _drawn(config: DeformConfig, rng: np.random.Generator) -> Deformation:
    reach = np.log(config.stretch)
    factors = np.exp(rng.uniform(-reach, reach, 3))
    if config.taper == config.bend == 0:
        return Deformation(factors)
    return Deformation(factors, rng.uniform(-config.taper, config.taper), rng.uniform(-config.bend, config.bend))


def _bent(
    points: Float64[np.ndarray, "n 3"], size: Float64[np.ndarray, "3"], angle: float
) -> Float64[np.ndarray, "n 3"]:
    along = int(size[1] > size[0])  # the longer horizontal side
    radius = size[along] / angle
    turn, distance = points[:, along] / radius, radius - points[:, 1 - along]
    bent = points.copy()
    bent[:, along], bent[:, 1 - along] = distance * np.sin(turn), radius - distance * np.cos(turn)
    return bent


def _mapped_parts(asset: ObjectAsset, deformation: Deformation) -> tuple[ConvexPart, ...]:
    return tuple(hull_part(deformation.apply(part.vertices, asset.extents)) for part in asset.parts)


def _outside(parts: tuple[ConvexPart, ...], points: Float64[np.ndarray, "n 3"]) -> float:
    """How far a point lies outside all parts, metres: the farthest one."""
    return float(np.min([part.depth(points) for part in parts], axis=0).max())


def _at_rest(
    asset: ObjectAsset, parts: tuple[ConvexPart, ...], vertices: Float64[np.ndarray, "v 3"], name: str
) -> ObjectAsset:
    resting = rest(parts)
    placed = tuple(ConvexPart(resting.place(part.vertices), part.faces) for part in resting.parts)
    mass = asset.mass_kg * _volume(placed) / _volume(asset.parts)
    return _copy(asset, name, mass, resting.place(vertices), placed)


def _stretched(asset: ObjectAsset, factors: Float64[np.ndarray, "3"], name: str) -> ObjectAsset:
    """Under diag(f): the face below stays below, and the centre of mass above the origin."""
    parts = tuple(ConvexPart(part.vertices * factors, part.faces) for part in asset.parts)
    # One density: the determinant of diag(f) times the mass. Centre and inertia are those of the stretched parts.
    return _copy(asset, name, asset.mass_kg * float(np.prod(factors)), asset.vertices * factors, parts)


def _copy(
    asset: ObjectAsset, name: str, mass: float, vertices: Float64[np.ndarray, "v 3"], parts: tuple[ConvexPart, ...]
) -> ObjectAsset:
    """Another object of the same source and split; also where the first one is known by its number."""
    center, inertia = mass_properties(parts)
    return ObjectAsset(name, asset.source, asset.split, mass, vertices, asset.faces, parts, center, inertia)


def _volume(parts: tuple[ConvexPart, ...]) -> float:
    return sum(signed_volume(part.vertices[part.faces]) for part in parts)
