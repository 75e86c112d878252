"""Compiled loops of the stereo model (`stereo`): what a pixel is matched to, and what is returned for it.

1. Window. If the nearer surface fills a large enough share of the window, a share that wanders along the edge, the
   pixel is matched to that surface. Otherwise it keeps its own, if that has the support, or takes the farther one (a
   thin part vanishes), or nothing.
2. Occlusion. A ray goes from the matched point to the second camera; where it meets the object there is no match.
3. Return. The disparity is disturbed and rounded; where texture is weak the match is rejected.

Disparities of `Matches` are in pixels here.
"""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit

from bayesgrasp.depth.light_kernels import Matches, edge_shift, shadow_ray
from bayesgrasp.depth.ray_kernels import TABLE, cosine_at, inverse_depth_at, table_cosine
from bayesgrasp.depth.return_kernels import BARE_TABLE, interpolate, lattice_weights

EDGE_DEVIATION = 0.8
"""By how much the border of a hole on the table wanders, px."""
NEARER, OWN, FARTHER, NOTHING = 0, 1, 2, 3


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def returned_depth(disparity, cosine, noise, texture, constants, column, width, near, far):
    """The depth (m) that is returned for a disparity in px; 0 where the match is weak or out of range."""
    weakness = np.exp(-constants.texture_spread * texture) / max(cosine, 1e-6)
    there = column - constants.side * disparity
    if disparity <= 0 or weakness > constants.weakest or there < 0 or there > width - 1:
        return np.float32(0.0)
    found = np.rint((disparity + constants.subpixel * weakness * noise) / constants.step) * constants.step
    z = np.float32(constants.depth_constant / found)
    return z if found > 0 and near <= z <= far else np.float32(0.0)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def sense_table(view, constants, noise, texture, width, near, far, rows, columns, image):
    """The bare table: fill the image (len(rows), len(columns)), float32 metres."""
    pitch, coarse = constants.noise_pitch, constants.texture_pitch
    noise_row, noise_column = lattice_weights(rows, 0, pitch), lattice_weights(columns, 0, pitch)
    blob_row, blob_column = lattice_weights(rows, 0, coarse), lattice_weights(columns, 0, coarse)
    for i in range(len(rows)):
        for j in range(len(columns)):
            u, v = columns[j], rows[i]
            disparity = constants.depth_constant * inverse_depth_at(view, np.empty((0, 4)), TABLE, u, v)
            blob = interpolate(texture, blob_row, blob_column, i, j)
            error = interpolate(noise, noise_row, noise_column, i, j)
            image[i, j] = returned_depth(
                disparity, table_cosine(view, u, v), error, blob, constants, u, width, near, far
            )


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def windowed_match(region, constants, share, row, column):
    """What the window around a pixel of the region is matched to: which surface, disparity (px), and plane."""
    w, plane, half = region.inverse_depth, region.plane, constants.half_window
    own, tolerance = w[row, column], constants.same_surface / constants.depth_constant
    count, total, planes = np.zeros(3), np.zeros(3), np.full(3, TABLE)
    for r in range(max(row - half, 0), min(row + half + 1, w.shape[0])):
        for c in range(max(column - half, 0), min(column + half + 1, w.shape[1])):
            kind = OWN
            if w[r, c] > own + tolerance:
                kind = NEARER
            elif w[r, c] < own - tolerance:
                kind = FARTHER
            count[kind] += 1
            total[kind] += w[r, c]
            planes[kind] = plane[r, c]
    size = count.sum()
    kind = NOTHING
    if count[NEARER] > 0 and count[NEARER] >= share * size:
        kind = NEARER
    elif count[FARTHER] > 0 and count[FARTHER] > (1 - share) * size:
        kind = FARTHER
    elif count[OWN] >= constants.min_support * size:
        return OWN, own * constants.depth_constant, plane[row, column]
    if kind == NOTHING:
        return NOTHING, 0.0, TABLE
    return kind, total[kind] / count[kind] * constants.depth_constant, planes[kind]


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def match(view, planes, region, noise, constants, near, hidden, rows, columns):
    """Step 1, and the rays of step 2, for the pixels rows x columns of the image, all inside the region.

    `noise` holds two lattices (2, ., .) of the region; `near` and `hidden` are the columns of each row where there may
    be more than bare table, and where the second camera may not see the table.
    """
    count = len(rows) * len(columns)
    disparity, cosine, ray = np.zeros(count), np.zeros(count), np.full(count, -1)
    origins, directions = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    by_row = lattice_weights(rows, region.row, constants.noise_pitch)
    by_column = lattice_weights(columns, region.column, constants.noise_pitch)
    i, used = -1, 0
    for k in range(len(rows)):
        for j in range(len(columns)):
            i += 1
            u, v = columns[j], rows[k]
            if not near[v, 0] <= u < near[v, 1]:
                disparity[i] = BARE_TABLE
                continue
            r, c = v - region.row, u - region.column
            if region.inverse_depth[r, c] <= 0:
                continue
            wander = constants.fattening + constants.fattening_spread * interpolate(noise[0], by_row, by_column, k, j)
            share = min(max(wander, 0.05), 0.5)
            kind, disparity[i], plane = windowed_match(region, constants, share, r, c)
            cosine[i] = cosine_at(view, planes, plane, u, v)
            if kind != OWN or disparity[i] <= 0:
                continue  # a surface taken from beside this pixel is one that both cameras see
            w = region.inverse_depth[r, c]
            if plane == TABLE:
                u += edge_shift(EDGE_DEVIATION, interpolate(noise[1], by_row, by_column, k, j))
                w = inverse_depth_at(view, planes, TABLE, u, v)
                if w <= 0 or not hidden[v, 0] <= u < hidden[v, 1]:
                    continue
            if shadow_ray(view, planes, plane, u, v, w, origins[used], directions[used]):
                ray[i] = used
                used += 1
            else:
                disparity[i] = 0.0
    return Matches(disparity, cosine, ray, origins[:used], directions[:used])


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def sense_matches(matches, blocked, constants, noise, texture, width, near, far, rows, columns, image):
    """Step 3 for matched pixels: overwrite their part of the image.

    `blocked` is at least 0 for each ray to the second camera that met the object.
    """
    pitch, coarse = constants.noise_pitch, constants.texture_pitch
    noise_row, noise_column = lattice_weights(rows, 0, pitch), lattice_weights(columns, 0, pitch)
    blob_row, blob_column = lattice_weights(rows, 0, coarse), lattice_weights(columns, 0, coarse)
    for k in range(len(matches.ray)):
        i, j = k // len(columns), k % len(columns)
        ray, disparity = matches.ray[k], matches.disparity[k]
        if disparity == BARE_TABLE:
            continue
        image[i, j] = 0.0
        if ray < 0 or blocked[ray] < 0:
            blob = interpolate(texture, blob_row, blob_column, i, j)
            error = interpolate(noise, noise_row, noise_column, i, j)
            image[i, j] = returned_depth(
                disparity, matches.cosine[k], error, blob, constants, columns[j], width, near, far
            )
