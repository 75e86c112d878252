"""Compiled loops of the structured-light model: what a pixel is matched to, whether it is lit, what it returns.

1. Edge. The pixel looks at a place moved by smooth noise with the published lateral deviation. If the disparity jumps
   on the way (more than the slope of its own surface explains), it takes the surface found there: edges wander.
2. Window. The share of the correlation window with about the same disparity must reach the minimum support. A pixel
   without it is matched to the other surface in the window if that one has the support (a thin rod vanishes into its
   background), and to nothing otherwise.
3. Shadow. A matched point that the projector does not see returns nothing.
4. Return. The disparity is disturbed and rounded (`kinect`); grazing surfaces return less and less often.

Noise is interpolated between standard normal numbers on a lattice and scaled back to unit variance at every pixel.
"""

from __future__ import annotations

from typing import NamedTuple, no_type_check

import numpy as np
from numba import njit  # type: ignore[import-untyped]

from bayesgrasp.simulators.kinect import AXIAL_TILT_START, DEPTH_CONSTANT, DISPARITY_OFFSET, STEEPEST_TILT
from bayesgrasp.simulators.ray_kernels import TABLE, cosine_at, inverse_depth_at

REACH = 4
"""Lateral noise is cut off at this many pixels, five standard deviations."""
CLEARANCE = 2e-4
"""A shadow ray starts this far (m, along the line of sight) in front of its surface, so that it does not meet it."""
COS_TILT_START = np.cos(AXIAL_TILT_START)
COS_STEEPEST = np.cos(STEEPEST_TILT)


class Matches(NamedTuple):
    """What the pixels of a box were matched to; one entry per evaluated pixel, row by row.

    Attributes:
        disparity: In steps (348 / depth), 0 for none; float64 (n,).
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
def lattice_noise(lattice, pitch, row, column):
    """Bilinear interpolation of a lattice of independent normal numbers, with unit variance at every pixel."""
    i, j = row // pitch, column // pitch
    fv, fu = (row - i * pitch) / pitch, (column - j * pitch) / pitch
    gv, gu = 1 - fv, 1 - fu
    value = gv * (gu * lattice[i, j] + fu * lattice[i, j + 1]) + fv * (
        gu * lattice[i + 1, j] + fu * lattice[i + 1, j + 1]
    )
    return value / np.sqrt((fu * fu + gu * gu) * (fv * fv + gv * gv))


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def edge_shift(sigma, noise):
    """A shift of `sigma` px times standard noise, cut off, so that its rounded value has that deviation."""
    spread = np.sqrt(max(sigma * sigma - 1 / 12, 0.0))
    return int(np.rint(min(max(spread * noise, -REACH), REACH)))


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def windowed_disparity(region, constants, row, column):
    """Disparity (steps) and plane that the window around a pixel of the region is matched to; 0 for none."""
    w, plane = region.inverse_depth, region.plane
    own, half = w[row, column] * DEPTH_CONSTANT, constants.half_window
    top, bottom = max(row - half, 0), min(row + half + 1, w.shape[0])
    left, right = max(column - half, 0), min(column + half + 1, w.shape[1])
    needed = constants.min_support * ((bottom - top) * (right - left))
    support, others, total = 0, 0, 0.0
    for r in range(top, bottom):
        for c in range(left, right):
            q = w[r, c] * DEPTH_CONSTANT
            if abs(q - own) < constants.same_surface:
                support += 1
            else:
                others += 1
                total += q
        if support >= needed:
            return own, plane[row, column]
    if others < needed:
        return 0.0, TABLE
    mean, other_plane, support = total / others, TABLE, 0
    for r in range(top, bottom):
        for c in range(left, right):
            if abs(w[r, c] * DEPTH_CONSTANT - mean) < constants.same_surface:
                support += 1
                other_plane = plane[r, c]
    return (mean, other_plane) if support >= needed else (0.0, TABLE)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def moved_pixel(view, planes, region, noise, constants, row, column):
    """The pixel of the region whose surface pixel (row, column) of the image takes: itself, except near edges."""
    r, c = row - region.row, column - region.column
    plane = region.plane[r, c]
    tilt = np.arccos(max(cosine_at(view, planes, plane, column, row), COS_STEEPEST))
    sigma = constants.lateral_gain * (0.8 + 0.035 * tilt / (np.pi / 2 - tilt))
    dr = edge_shift(sigma, lattice_noise(noise[0], constants.noise_pitch, r, c))
    dc = edge_shift(sigma, lattice_noise(noise[1], constants.noise_pitch, r, c))
    r2 = min(max(r + dr, 0), region.plane.shape[0] - 1)
    c2 = min(max(c + dc, 0), region.plane.shape[1] - 1)
    expected = inverse_depth_at(view, planes, plane, c2 + region.column, r2 + region.row)
    if abs(region.inverse_depth[r2, c2] - expected) * DEPTH_CONSTANT > constants.edge_step:
        return r2, c2
    return r, c


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
def match(view, planes, region, noise, constants, spans, rows, columns, with_shadow):
    """Steps 1 and 2, and the rays of step 3, for the pixels rows x columns of the image, all inside the region.

    `noise` holds lattices (>= 2, ., .) of the region; `spans` are the columns of each row where there may be shadow.
    """
    count = len(rows) * len(columns)
    disparity, cosine, ray = np.zeros(count), np.zeros(count), np.full(count, -1)
    origins, directions = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    i, used = 0, 0
    for row in rows:
        for column in columns:
            r, c = moved_pixel(view, planes, region, noise, constants, row, column)
            q, plane = 0.0, TABLE
            if region.inverse_depth[r, c] > 0:
                q, plane = windowed_disparity(region, constants, r, c)
            u, v = c + region.column, r + region.row
            cosine[i] = cosine_at(view, planes, plane, u, v)
            shaded = with_shadow and q > 0 and spans[v, 0] <= u < spans[v, 1]
            if shaded and shadow_ray(view, planes, plane, u, v, q / DEPTH_CONSTANT, origins[used], directions[used]):
                ray[i] = used
                used += 1
            elif shaded:
                q = 0.0
            disparity[i] = q
            i += 1
    return Matches(disparity, cosine, ray, origins[:used], directions[:used])


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def returned_depth(disparity, cosine, noise, constants, near, far):
    """The depth (m) that the device returns for a disparity in steps: disturbed, rounded, 0 out of range."""
    z = DEPTH_CONSTANT / disparity
    sigma = 0.0012 + 0.0019 * (z - 0.4) ** 2
    if cosine < COS_TILT_START:
        tilt = np.arccos(max(cosine, COS_STEEPEST))
        sigma += 1e-4 / np.sqrt(z) * (tilt / (np.pi / 2 - tilt)) ** 2
    steps = constants.axial_gain * sigma * disparity * disparity / DEPTH_CONSTANT
    q = np.floor(disparity + noise * np.sqrt(max(steps * steps - 1 / 12, 0.0))) + 0.5
    z = np.float32(DEPTH_CONSTANT / q)
    return z if 0 < q <= DISPARITY_OFFSET and near <= z <= far else np.float32(0.0)


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
def sense_table(view, planes, constants, axial, near, far, rows, columns, image):
    """Step 4 for the bare table: fill the image (len(rows), len(columns)), float32 metres."""
    for i in range(len(rows)):
        for j in range(len(columns)):
            q = inverse_depth_at(view, planes, TABLE, columns[j], rows[i]) * DEPTH_CONSTANT
            image[i, j] = 0.0
            if q > 0:
                cosine = cosine_at(view, planes, TABLE, columns[j], rows[i])
                noise = lattice_noise(axial, constants.noise_pitch, rows[i], columns[j])
                image[i, j] = returned_depth(q, cosine, noise, constants, near, far)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def sense_matches(matches, blocked, constants, axial, grazing, origin, near, far, rows, columns, image):
    """Step 4 for matched pixels: overwrite their part of the image.

    `blocked` is at least 0 for each shadow ray that met the object; `origin` is the first (row, column) of the region,
    whose lattice `grazing` is.
    """
    k = 0
    for i in range(len(rows)):
        for j in range(len(columns)):
            ray, q = matches.ray[k], matches.disparity[k]
            image[i, j] = 0.0
            if q > 0 and (ray < 0 or blocked[ray] < 0):
                drop = lattice_noise(grazing, constants.noise_pitch, rows[i] - origin[0], columns[j] - origin[1])
                if not returns_nothing(matches.cosine[k], drop, constants):
                    noise = lattice_noise(axial, constants.noise_pitch, rows[i], columns[j])
                    image[i, j] = returned_depth(q, matches.cosine[k], noise, constants, near, far)
            k += 1
