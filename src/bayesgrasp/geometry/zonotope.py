"""Do two zonotopes meet? A zonotope is a centre plus all combinations of its generators with factors in [-1, 1].

Boxes are zonotopes of three generators, and what a box sweeps along a straight line is one of four. Two of them meet if
and only if no direction separates them, and if one does, so does a normal of a face of their sum: the cross product of
two of all their generators (the separating axis theorem). In a direction n, zonotopes with centres a and b and
generators g_i are apart if

    |n . (a - b)| > sum_i |n . g_i|.

Cross products of parallel generators are rounding noise or zero. Noise, normalised, is one more direction to look
along, which may separate but never errs; zero separates nothing.
"""

from __future__ import annotations

import itertools

import numpy as np
from jaxtyping import Bool, Float64


def meet(
    center: Float64[np.ndarray, "*batch 3"],
    generators: Float64[np.ndarray, "*batch g 3"],
    other_center: Float64[np.ndarray, "3"],
    other_generators: Float64[np.ndarray, "k 3"],
) -> Bool[np.ndarray, "*batch"]:
    """Whether each zonotope of a batch has a point in common with one other.

    Args:
        center: Centres.
        generators: Generators, from the centre, as long as half a box's sides.
        other_center: Of the other one.
        other_generators: Of the other one.
    """
    others = np.broadcast_to(other_generators, (*center.shape[:-1], *other_generators.shape))
    every = np.concatenate([generators, others], axis=-2)
    first, second = np.array(list(itertools.combinations(range(every.shape[-2]), 2))).T
    direction = np.cross(every[..., first, :], every[..., second, :])
    length = np.linalg.norm(direction, axis=-1, keepdims=True)
    direction = np.divide(direction, length, out=np.zeros_like(direction), where=length > 0)
    reach = np.abs(direction @ np.swapaxes(every, -1, -2)).sum(-1)
    apart = np.abs((direction @ (center - other_center)[..., None])[..., 0]) > reach
    meets: np.ndarray = ~apart.any(-1)
    return meets
