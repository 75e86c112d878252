"""Compiled loops of the structured-light model: what a pixel is matched to, whether it is lit, and what is returned.

1. Edge. The pixel looks at a place moved by smooth noise with the published lateral deviation. If the disparity jumps
   on the way (more than the slope of its own surface explains), it takes the surface found there: edges wander. On the
   table it also takes the light or shadow found there.
2. Window. The share of the correlation window with about the same disparity must reach the minimum support. A pixel
   without it is matched to the other surface in the window if that one has the support (a thin rod vanishes into its
   background), and to nothing otherwise.
3. Shadow. A matched point that the projector does not see returns nothing.
4. Return. The disparity is disturbed and rounded, and grazing surfaces return less and less often.

The laws are in `kinect`; disparities are in its steps.
"""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit

from bayesgrasp.depth.frame import BARE_TABLE, TABLE, Matches
from bayesgrasp.depth.kinect import (
    COS_STEEPEST,
    COS_TILT_START,
    DEPTH_CONSTANT,
    DISPARITY_OFFSET,
    axial_sigma,
    lateral_sigma,
    quantised,
    steep_sigma,
)
from bayesgrasp.depth.match_kernels import edge_shift, interpolate, no_matches, pixel_weights, ray_to_second_eye
from bayesgrasp.depth.ray_kernels import cosine_at, inverse_depth_at, table_cosine


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def count_like(w, top, bottom, left, right, value, tolerance, enough):
    """How many entries of a window of w are within a tolerance of a value; stops counting after `enough`."""
    count = 0
    for r in range(top, bottom):
        for c in range(left, right):
            count += abs(w[r, c] - value) < tolerance
        if count >= enough:
            break
    return count


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def windowed_disparity(region, constants, row, column):
    """Disparity (steps) and plane that the window around a pixel of the region is matched to; 0 for none."""
    w, plane = region.inverse_depth, region.plane
    own, half = w[row, column], constants.half_window
    top, bottom = max(row - half, 0), min(row + half + 1, w.shape[0])
    left, right = max(column - half, 0), min(column + half + 1, w.shape[1])
    needed = constants.min_support * ((bottom - top) * (right - left))
    tolerance = constants.same_surface / DEPTH_CONSTANT  # of inverse depths, as disparity = 348 / depth
    if count_like(w, top, bottom, left, right, own, tolerance, needed) >= needed:
        return own * DEPTH_CONSTANT, plane[row, column]
    # All that is not the pixel's own surface counts as one other surface, at its mean; the second count below says
    # whether it is one: of two surfaces the mean lies between them, where nothing is.
    others, total, other_plane = 0, 0.0, TABLE
    for r in range(top, bottom):
        for c in range(left, right):
            if abs(w[r, c] - own) >= tolerance:
                others += 1
                total += w[r, c]
                other_plane = plane[r, c]
    if others < needed or count_like(w, top, bottom, left, right, total / others, tolerance, needed) < needed:
        return 0.0, TABLE
    return total / others * DEPTH_CONSTANT, other_plane


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def moved_pixel(view, planes, region, constants, noise_v, noise_u, r, c):
    """Row and column in the region of the place that pixel (r, c) of the region looks at."""
    plane, u, v = region.plane[r, c], c + region.column, r + region.row
    tilt = np.arccos(max(cosine_at(view, planes, plane, u, v), COS_STEEPEST))
    sigma = constants.lateral_gain * lateral_sigma(tilt)
    moved_r = min(max(r + edge_shift(sigma, noise_v), 0), region.plane.shape[0] - 1)
    moved_c = min(max(c + edge_shift(sigma, noise_u), 0), region.plane.shape[1] - 1)
    return moved_r, moved_c


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def is_edge(view, planes, region, constants, r, c, moved_r, moved_c):
    """Whether disparity jumps from a pixel of the region to another one, beyond the slope of its own surface."""
    if region.plane[r, c] == TABLE and region.plane[moved_r, moved_c] == TABLE:
        return False
    u, v = moved_c + region.column, moved_r + region.row
    expected = inverse_depth_at(view, planes, region.plane[r, c], u, v)
    return abs(region.inverse_depth[moved_r, moved_c] - expected) * DEPTH_CONSTANT > constants.edge_step


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def match(frame, around, pixels, constants):
    """Steps 1 and 2, and the rays of step 3, for pixels that are all inside the region; see `frame`.

    The region's noise is of the place of edges, along rows and along columns.
    """
    view, planes, region = frame.camera, around.planes, around.region
    rows, columns, near, shaded = pixels.rows, pixels.columns, around.near, around.hidden
    along_rows, along_columns = around.noise[0], around.noise[1]
    disparity, cosine, ray, origins, directions = no_matches(len(rows) * len(columns))
    by_row, by_column = pixel_weights(pixels, region.row, region.column, constants.noise_pitch)
    i, used = -1, 0
    for k in range(len(rows)):
        for j in range(len(columns)):
            i += 1
            if not near[rows[k], 0] <= columns[j] < near[rows[k], 1]:
                disparity[i] = BARE_TABLE
                continue
            r, c = rows[k] - region.row, columns[j] - region.column
            noise_v = interpolate(along_rows, by_row, by_column, k, j)
            noise_u = interpolate(along_columns, by_row, by_column, k, j)
            at_r, at_c = moved_pixel(view, planes, region, constants, noise_v, noise_u, r, c)
            if is_edge(view, planes, region, constants, r, c, at_r, at_c):
                r, c = at_r, at_c
            if region.inverse_depth[r, c] <= 0:
                continue
            disparity[i], plane = windowed_disparity(region, constants, r, c)
            u, v, w = c + region.column, r + region.row, disparity[i] / DEPTH_CONSTANT
            cosine[i] = cosine_at(view, planes, plane, u, v)
            if plane == TABLE:  # the edges of shadows wander too
                u, v = at_c + region.column, at_r + region.row
                w = inverse_depth_at(view, planes, TABLE, u, v)
            if disparity[i] > 0 and w > 0 and shaded[v, 0] <= u < shaded[v, 1]:
                if ray_to_second_eye(view, planes, plane, u, v, w, origins[used], directions[used]):
                    ray[i] = used
                    used += 1
                else:
                    disparity[i] = 0.0
    return Matches(disparity, cosine, ray, origins[:used], directions[:used])


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def returned_depth(disparity, steep, noise, gain, limits):
    """The depth (m) that the device returns for a disparity in steps: disturbed, rounded, 0 out of range.

    `steep` is `steep_sigma`. There are no branches, so that a loop over it becomes vector instructions.
    """
    # The published deviation in steps, by the size of a step: z^2 / 348 = 348 / q^2.
    steps = gain * axial_sigma(DEPTH_CONSTANT / disparity, steep) * disparity * disparity / DEPTH_CONSTANT
    # Rounding has a variance of 1/12 step^2 of its own, which the published deviation includes.
    q = quantised(disparity + noise * np.sqrt(max(steps * steps - 1 / 12, 0.0)))
    z = np.float32(DEPTH_CONSTANT / q)
    returned = (disparity > 0) & (q > 0) & (q <= DISPARITY_OFFSET) & (z >= limits.near) & (z <= limits.far)
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
def sense_table(frame, pixels, constants):
    """Step 4 for the bare table: fill the image; see `frame`. The frame's noise is of the measured depth."""
    view, limits, rows, columns, image = frame.camera, frame.limits, pixels.rows, pixels.columns, pixels.image
    m, gain, axial = view.ray_matrix, constants.axial_gain, frame.noise[0]
    by_row, by_column = pixel_weights(pixels, 0, 0, constants.noise_pitch)
    noise, steep, disparity = np.empty(len(columns)), np.zeros(len(columns)), np.empty(len(columns))
    # The table's inverse depth is affine in the pixel (`ray_kernels`), so a row of it is a slope and an offset.
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
            image[i, j] = returned_depth(disparity[j], steep[j], noise[j], gain, limits)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def sense_matches(frame, around, pixels, constants, matches, blocked):
    """Step 4 for matched pixels: overwrite their part of the image; see `frame`.

    `blocked` is at least 0 for each ray that met the object on its way to the projector.
    """
    columns, image, region = pixels.columns, pixels.image, around.region
    axial, grazing = frame.noise[0], around.noise[2]
    by_row, by_column = pixel_weights(pixels, 0, 0, constants.noise_pitch)
    local_row, local_column = pixel_weights(pixels, region.row, region.column, constants.noise_pitch)
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
                image[i, j] = returned_depth(q, steep_sigma(q, cosine), noise, constants.axial_gain, frame.limits)
