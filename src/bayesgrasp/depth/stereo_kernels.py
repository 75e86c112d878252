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

from bayesgrasp.depth.frame import BARE_TABLE, TABLE, Matches
from bayesgrasp.depth.match_kernels import edge_shift, interpolate, no_matches, pixel_weights, ray_to_second_eye
from bayesgrasp.depth.ray_kernels import cosine_at, inverse_depth_at, table_cosine

EDGE_DEVIATION = 0.8
"""By how much the border of a hole on the table wanders, px."""
NEARER, OWN, FARTHER, NOTHING = 0, 1, 2, 3


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def weakness(cosine, texture, constants):
    """The deviation of a match as a multiple of `subpixel`, by the law of texture in `stereo`; `texture` is its t."""
    return np.exp(-constants.texture_spread * texture) / max(cosine, 1e-6)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def returned_depth(disparity, column, weak, noise, constants, limits):
    """The depth (m) that is returned for a disparity in px; 0 where the match is weak or out of range."""
    there = column - constants.side * disparity  # the column in which the other camera sees the point
    if disparity <= 0 or weak > constants.weakest or there < 0 or there > limits.width - 1:
        return np.float32(0.0)
    found = np.rint((disparity + constants.subpixel * weak * noise) / constants.step) * constants.step
    z = np.float32(constants.depth_constant / found)
    return z if found > 0 and limits.near <= z <= limits.far else np.float32(0.0)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def sense_table(frame, pixels, constants):
    """The bare table: fill the image; see `frame`. The frame's noise is of disparities, then of texture."""
    view, rows, columns, image = frame.camera, pixels.rows, pixels.columns, pixels.image
    error, texture = frame.noise
    error_row, error_column = pixel_weights(pixels, 0, 0, constants.noise_pitch)
    blob_row, blob_column = pixel_weights(pixels, 0, 0, constants.texture_pitch)
    for i in range(len(rows)):
        for j in range(len(columns)):
            u, v = columns[j], rows[i]
            disparity = constants.depth_constant * inverse_depth_at(view, np.empty((0, 4)), TABLE, u, v)
            weak = weakness(table_cosine(view, u, v), interpolate(texture, blob_row, blob_column, i, j), constants)
            noise = interpolate(error, error_row, error_column, i, j)
            image[i, j] = returned_depth(disparity, u, weak, noise, constants, frame.limits)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def windowed_match(region, constants, share, row, column):
    """What the window around a pixel of the region is matched to: which surface, disparity (px), and plane."""
    w, plane, half = region.inverse_depth, region.plane, constants.half_window
    own, tolerance = w[row, column], constants.same_surface / constants.depth_constant
    count, total, planes = np.zeros(3), np.zeros(3), np.full(3, TABLE)
    for r in range(max(row - half, 0), min(row + half + 1, w.shape[0])):
        for c in range(max(column - half, 0), min(column + half + 1, w.shape[1])):
            kind = OWN  # inverse depths: more is nearer
            if w[r, c] > own + tolerance:
                kind = NEARER
            elif w[r, c] < own - tolerance:
                kind = FARTHER
            count[kind] += 1
            total[kind] += w[r, c]
            planes[kind] = plane[r, c]
    # The nearer surface wins with `share` of the window, the farther one where less than that is left for all others.
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
def match(frame, around, pixels, constants):
    """Step 1, and the rays of step 2, for pixels that are all inside the region; see `frame`.

    The region's noise is of the place of edges, and of the borders of holes.
    """
    view, planes, region = frame.camera, around.planes, around.region
    rows, columns, near, hidden = pixels.rows, pixels.columns, around.near, around.hidden
    of_edges, of_holes = around.noise[0], around.noise[1]
    disparity, cosine, ray, origins, directions = no_matches(len(rows) * len(columns))
    by_row, by_column = pixel_weights(pixels, region.row, region.column, constants.noise_pitch)
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
            edge = interpolate(of_edges, by_row, by_column, k, j)
            # A nearer surface with half of the window wins in any case, and none does with next to nothing of it.
            share = min(max(constants.fattening + constants.fattening_spread * edge, 0.05), 0.5)
            kind, disparity[i], plane = windowed_match(region, constants, share, r, c)
            cosine[i] = cosine_at(view, planes, plane, u, v)
            if kind != OWN or disparity[i] <= 0:
                continue  # a surface taken from beside this pixel is one that both cameras see
            w = region.inverse_depth[r, c]
            if plane == TABLE:  # the borders of holes wander
                u += edge_shift(EDGE_DEVIATION, interpolate(of_holes, by_row, by_column, k, j))
                w = inverse_depth_at(view, planes, TABLE, u, v)
                if w <= 0 or not hidden[v, 0] <= u < hidden[v, 1]:
                    continue
            if ray_to_second_eye(view, planes, plane, u, v, w, origins[used], directions[used]):
                ray[i] = used
                used += 1
            else:
                disparity[i] = 0.0
    return Matches(disparity, cosine, ray, origins[:used], directions[:used])


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def sense_matches(frame, pixels, constants, matches, blocked):
    """Step 3 for matched pixels: overwrite their part of the image; see `frame`.

    `blocked` is at least 0 for each ray to the second camera that met the object.
    """
    columns, image = pixels.columns, pixels.image
    error, texture = frame.noise
    error_row, error_column = pixel_weights(pixels, 0, 0, constants.noise_pitch)
    blob_row, blob_column = pixel_weights(pixels, 0, 0, constants.texture_pitch)
    for k in range(len(matches.ray)):
        i, j = k // len(columns), k % len(columns)
        ray, disparity = matches.ray[k], matches.disparity[k]
        if disparity == BARE_TABLE:
            continue
        image[i, j] = 0.0
        if ray < 0 or blocked[ray] < 0:
            weak = weakness(matches.cosine[k], interpolate(texture, blob_row, blob_column, i, j), constants)
            noise = interpolate(error, error_row, error_column, i, j)
            image[i, j] = returned_depth(disparity, columns[j], weak, noise, constants, frame.limits)
