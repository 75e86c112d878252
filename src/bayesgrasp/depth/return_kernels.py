"""Compiled loops of the structured-light model: what the device returns for the disparities it matched.

A disparity is disturbed and rounded (`kinect`), and grazing surfaces return less and less often. Noise is interpolated
between standard normal numbers on a lattice, and scaled back to unit variance at every pixel.
"""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit

from bayesgrasp.depth.kinect import AXIAL_TILT_START, DEPTH_CONSTANT, DISPARITY_OFFSET, STEEPEST_TILT
from bayesgrasp.depth.ray_kernels import table_cosine

COS_TILT_START = np.cos(AXIAL_TILT_START)
COS_STEEPEST = np.cos(STEEPEST_TILT)
BARE_TABLE = -1.0
"""Disparity of a match that leaves the pixel as `sense_table` made it."""


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
def interpolate(lattice, by_row, by_column, i, j):
    """The lattice at the i-th row and j-th column of a pair of `lattice_weights`."""
    r, a, b = by_row[0][i], by_row[1][i], by_row[2][i]
    c, d, e = by_column[0][j], by_column[1][j], by_column[2][j]
    return a * (d * lattice[r, c] + e * lattice[r, c + 1]) + b * (d * lattice[r + 1, c] + e * lattice[r + 1, c + 1])


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def steep_sigma(disparity, cosine):
    """The part of the axial deviation (m) that only steep surfaces have."""
    if cosine >= COS_TILT_START or disparity <= 0:
        return 0.0
    tilt = np.arccos(max(cosine, COS_STEEPEST))
    return 1e-4 * np.sqrt(disparity / DEPTH_CONSTANT) * (tilt / (np.pi / 2 - tilt)) ** 2


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def returned_depth(disparity, steep, noise, gain, near, far):
    """The depth (m) that the device returns for a disparity in steps: disturbed, rounded, 0 out of range.

    `steep` is `steep_sigma`. There are no branches, so that a loop over it becomes vector instructions.
    """
    beyond = DEPTH_CONSTANT / disparity - 0.4
    steps = gain * (0.0012 + 0.0019 * beyond * beyond + steep) * disparity * disparity / DEPTH_CONSTANT
    q = np.floor(disparity + noise * np.sqrt(max(steps * steps - 1 / 12, 0.0))) + 0.5
    z = np.float32(DEPTH_CONSTANT / q)
    returned = (disparity > 0) & (q > 0) & (q <= DISPARITY_OFFSET) & (z >= near) & (z <= far)
    return z if returned else np.float32(0.0)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def returns_nothing(cosine, noise, constants):
    """Whether a surface at this tilt gives no return: a share that grows from 0 to 1 over the grazing tilts."""
    if cosine > np.cos(constants.grazing_start):
        return False
    tilt = np.arccos(cosine)
    share = (tilt - constants.grazing_start) / (constants.grazing_end - constants.grazing_start)
    # The share of a standard normal below `noise`, by the logistic approximation (error under 0.01).
    return share >= 1 or 1 / (1 + np.exp(-1.702 * noise)) < share


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def sense_table(view, constants, axial, near, far, rows, columns, image):
    """Step 4 for the bare table: fill the image (len(rows), len(columns)), float32 metres."""
    m, gain = view.ray_matrix, constants.axial_gain
    by_row = lattice_weights(rows, 0, constants.noise_pitch)
    by_column = lattice_weights(columns, 0, constants.noise_pitch)
    noise, steep, disparity = np.empty(len(columns)), np.zeros(len(columns)), np.empty(len(columns))
    slope = -m[2, 0] / view.origin[2] * DEPTH_CONSTANT
    for i in range(len(rows)):
        v = rows[i]
        offset = -(m[2, 1] * v + m[2, 2]) / view.origin[2] * DEPTH_CONSTANT
        for j in range(len(columns)):
            noise[j] = interpolate(axial, by_row, by_column, i, j)
            disparity[j] = offset + slope * columns[j]
        # Along a row the tilt is largest at one of the ends.
        if min(table_cosine(view, columns[0], v), table_cosine(view, columns[-1], v)) < COS_TILT_START:
            for j in range(len(columns)):
                steep[j] = steep_sigma(disparity[j], table_cosine(view, columns[j], v))
        else:
            steep[:] = 0.0
        for j in range(len(columns)):
            image[i, j] = returned_depth(disparity[j], steep[j], noise[j], gain, near, far)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def sense_matches(matches, blocked, constants, axial, grazing, corner, near, far, rows, columns, image):
    """Step 4 for matched pixels: overwrite their part of the image.

    `blocked` is at least 0 for each shadow ray that met the object; `corner` is the first (row, column) of the region,
    whose lattice `grazing` is.
    """
    pitch, gain = constants.noise_pitch, constants.axial_gain
    by_row, by_column = lattice_weights(rows, 0, pitch), lattice_weights(columns, 0, pitch)
    local_row, local_column = lattice_weights(rows, corner[0], pitch), lattice_weights(columns, corner[1], pitch)
    for k in range(len(matches.ray)):
        i, j = k // len(columns), k % len(columns)
        ray, q, cosine = matches.ray[k], matches.disparity[k], matches.cosine[k]
        if q == BARE_TABLE:
            continue
        image[i, j] = 0.0
        if q > 0 and (ray < 0 or blocked[ray] < 0):
            drop = interpolate(grazing, local_row, local_column, i, j)
            if not returns_nothing(cosine, drop, constants):
                noise = interpolate(axial, by_row, by_column, i, j)
                image[i, j] = returned_depth(q, steep_sigma(q, cosine), noise, gain, near, far)
