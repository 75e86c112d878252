"""Compiled loops that every device shares: smooth noise, places that wander, and rays to the second eye.

Noise is interpolated between standard normal numbers on a lattice, and scaled back to unit variance at every pixel.
"""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit

from bayesgrasp.depth.frame import TABLE, Matches

REACH = 4
"""Lateral noise is cut off at this many pixels, five standard deviations."""
CLEARANCE = 2e-4
"""A ray to the second eye starts this far (m, along the line of sight) in front of its surface, or it would meet it."""


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def no_matches(count):
    """Room for the `Matches` of so many pixels, each of which may need a ray."""
    origins, directions = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    return Matches(np.zeros(count), np.zeros(count), np.full(count, -1), origins, directions)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def lattice_weights(pixels, start, pitch):
    """Along one axis: the lattice node before each pixel, and the weights of that node and of the next one.

    `start` is the pixel of the first node. Weights have unit sum of squares, so that interpolating independent normal
    numbers of unit variance gives unit variance at every pixel.
    """
    node = (pixels - start) // pitch
    after = (pixels - start - node * pitch) / pitch
    norm = np.sqrt(after**2 + (1 - after) ** 2)
    return node, (1 - after) / norm, after / norm


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def pixel_weights(pixels, row, column, pitch):
    """`lattice_weights` of the rows and of the columns of pixels, for a lattice that begins at a row and a column."""
    return lattice_weights(pixels.rows, row, pitch), lattice_weights(pixels.columns, column, pitch)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def interpolate(lattice, by_row, by_column, i, j):
    """The lattice at the i-th row and j-th column of a pair of `lattice_weights`."""
    r, a, b = by_row[0][i], by_row[1][i], by_row[2][i]
    c, d, e = by_column[0][j], by_column[1][j], by_column[2][j]
    return a * (d * lattice[r, c] + e * lattice[r, c + 1]) + b * (d * lattice[r + 1, c] + e * lattice[r + 1, c + 1])


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def edge_shift(sigma, noise):
    """A shift of `sigma` px times standard noise, cut off, so that its rounded value has that deviation."""
    spread = np.sqrt(max(sigma * sigma - 1 / 12, 0.0))  # rounding to whole pixels adds a variance of 1/12
    return int(np.rint(min(max(spread * noise, -REACH), REACH)))


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def ray_to_second_eye(view, planes, plane, u, v, inverse_depth, origin, direction):
    """Write the ray from a seen point to the second eye; false if the surface is turned away from that eye.

    A surface shows both eyes the same side: with n its normal, p the point, d the line of sight and e the second eye,
    n . (e - p) and -n . d have one sign. Where they differ the point is on the far side, and no ray is needed.
    """
    facing_eye, facing_camera = 0.0, 0.0
    for k in range(3):
        d = view.ray_matrix[k, 0] * u + view.ray_matrix[k, 1] * v + view.ray_matrix[k, 2]
        point = view.origin[k] + d * (1 / inverse_depth - CLEARANCE)
        origin[k] = point
        direction[k] = view.second_eye[k] - point
        if plane != TABLE:
            facing_eye += planes[plane, k] * (view.second_eye[k] - point)
            facing_camera -= planes[plane, k] * d
    return plane == TABLE or facing_eye * facing_camera > 0
