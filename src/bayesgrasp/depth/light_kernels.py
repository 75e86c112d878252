"""Compiled loops of the structured-light model: what a pixel is matched to, and the rays that tell whether it is lit.

1. Edge. The pixel looks at a place moved by smooth noise with the published lateral deviation. If the disparity jumps
   on the way (more than the slope of its own surface explains), it takes the surface found there: edges wander. On the
   table it also takes the light or shadow found there.
2. Window. The share of the correlation window with about the same disparity must reach the minimum support. A pixel
   without it is matched to the other surface in the window if that one has the support (a thin rod vanishes into its
   background), and to nothing otherwise.
3. Shadow. A matched point that the projector does not see returns nothing.

What the device returns for a match is in `return_kernels`.
"""

from __future__ import annotations

from typing import NamedTuple, no_type_check

import numpy as np
from numba import njit

from bayesgrasp.depth.kinect import DEPTH_CONSTANT
from bayesgrasp.depth.ray_kernels import TABLE, cosine_at, inverse_depth_at
from bayesgrasp.depth.return_kernels import BARE_TABLE, COS_STEEPEST, interpolate, lattice_weights

REACH = 4
"""Lateral noise is cut off at this many pixels, five standard deviations."""
CLEARANCE = 2e-4
"""A shadow ray starts this far (m, along the line of sight) in front of its surface, so that it does not meet it."""


class Matches(NamedTuple):
    """What the pixels of a box were matched to; one entry per evaluated pixel, row by row.

    Attributes:
        disparity: In steps (348 / depth), 0 for none, `BARE_TABLE` for nothing but table; float64 (n,).
        cosine: Of the tilt, float64 (n,).
        ray: Index of its shadow ray, -1 if it needs none; int64 (n,).
        origins, directions: Shadow rays, object frame, float32 (m, 3).
    """

    disparity: np.ndarray
    cosine: np.ndarray
    ray: np.ndarray
    origins: np.ndarray
    directions: np.ndarray


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def edge_shift(sigma, noise):
    """A shift of `sigma` px times standard noise, cut off, so that its rounded value has that deviation."""
    spread = np.sqrt(max(sigma * sigma - 1 / 12, 0.0))
    return int(np.rint(min(max(spread * noise, -REACH), REACH)))


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
    tolerance = constants.same_surface / DEPTH_CONSTANT
    if count_like(w, top, bottom, left, right, own, tolerance, needed) >= needed:
        return own * DEPTH_CONSTANT, plane[row, column]
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
def moved_pixel(view, planes, region, noise_v, noise_u, constants, r, c):
    """Row and column in the region of the place that pixel (r, c) of the region looks at."""
    plane, u, v = region.plane[r, c], c + region.column, r + region.row
    tilt = np.arccos(max(cosine_at(view, planes, plane, u, v), COS_STEEPEST))
    sigma = constants.lateral_gain * (0.8 + 0.035 * tilt / (np.pi / 2 - tilt))
    moved_r = min(max(r + edge_shift(sigma, noise_v), 0), region.plane.shape[0] - 1)
    moved_c = min(max(c + edge_shift(sigma, noise_u), 0), region.plane.shape[1] - 1)
    return moved_r, moved_c


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def is_edge(view, planes, region, constants, r, c, moved_r, moved_c):
    """Whether disparity jumps from a pixel of the region to another one, beyond the slope of its own surface."""
    if region.plane[r, c] == TABLE and region.plane[moved_r, moved_c] == TABLE:
        return False
    expected = inverse_depth_at(view, planes, region.plane[r, c], moved_c + region.column, moved_r + region.row)
    return abs(region.inverse_depth[moved_r, moved_c] - expected) * DEPTH_CONSTANT > constants.edge_step


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def shadow_ray(view, planes, plane, u, v, inverse_depth, origin, direction):
    """Write the ray from a seen point to the projector; false if the surface is turned away from the projector."""
    facing_light, facing_camera = 0.0, 0.0
    for k in range(3):
        d = view.ray_matrix[k, 0] * u + view.ray_matrix[k, 1] * v + view.ray_matrix[k, 2]
        point = view.origin[k] + d * (1 / inverse_depth - CLEARANCE)
        origin[k] = point
        direction[k] = view.projector[k] - point
        if plane != TABLE:
            facing_light += planes[plane, k] * (view.projector[k] - point)
            facing_camera -= planes[plane, k] * d
    return plane == TABLE or facing_light * facing_camera > 0


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def match(view, planes, region, noise, constants, near, shaded, rows, columns):
    """Steps 1 and 2, and the rays of step 3, for the pixels rows x columns of the image, all inside the region.

    `noise` holds lattices (>= 2, ., .) of the region; `near` and `shaded` are the columns of each row where there may
    be more than bare table, and where there may be shadow.
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
            if not near[rows[k], 0] <= columns[j] < near[rows[k], 1]:
                disparity[i] = BARE_TABLE
                continue
            r, c = rows[k] - region.row, columns[j] - region.column
            noise_v = interpolate(noise[0], by_row, by_column, k, j)
            noise_u = interpolate(noise[1], by_row, by_column, k, j)
            at_r, at_c = moved_pixel(view, planes, region, noise_v, noise_u, constants, r, c)
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
                if shadow_ray(view, planes, plane, u, v, w, origins[used], directions[used]):
                    ray[i] = used
                    used += 1
                else:
                    disparity[i] = 0.0
    return Matches(disparity, cosine, ray, origins[:used], directions[:used])
