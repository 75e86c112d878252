"""Compiled look-ups of local evidence, and their derivatives in the pose of the hand.

With R and x the pose of a hand, p a point of it, and C, t those of the camera,

    c = C^T (R p + x - t),    u = f_x c_x / c_z + o_x,    v = f_y c_y / c_z + o_y,

signed depth s = c_z - D(u, v) and learned channels M(u, v), bilinearly from the nearest four pixels, outside the image
from its border (`evidence.sample`). What the head is told of a point are s / scale for each scale and
(s - unit M) / spread for each learned surface, before tanh, and learned features M at every so many points.
"""

from __future__ import annotations

from typing import NamedTuple, no_type_check

import numpy as np
from numba import njit

from bayesgrasp.ratio.evidence import NEAREST_DEPTH


class Eye(NamedTuple):
    """A camera and the points of the hand that it looks at.

    Attributes:
        points: In the hand frame, (3, p), metres.
        rotation: camera_to_world, (3, 3).
        translation: Position of the camera, (3,), metres, world frame.
        focal: (2,), pixels.
        center: (2,), pixels.
    """

    points: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    focal: np.ndarray
    center: np.ndarray


class Evidence(NamedTuple):
    """What is looked up.

    Attributes:
        depth: Measured depth, (height, width), metres.
        offsets: Of learned surfaces behind the measured one, (rows, columns, m), in units.
        features: Learned features, (rows, columns, c).
        window: (scale of u, its offset, scale of v, its offset): pixels of the image to those of the maps.
        scales: Signed depth over each of these, (s,), metres.
        unit: Metres of an offset of 1.
        spread: Signed depth against a learned surface over this, metres.
        every: Features are looked up at every so many points.
    """

    depth: np.ndarray
    offsets: np.ndarray
    features: np.ndarray
    window: np.ndarray
    scales: np.ndarray
    unit: float
    spread: float
    every: int


KERNEL = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": True}
ZERO, ONE, NEAR = np.float32(0), np.float32(1), np.float32(NEAREST_DEPTH)


@no_type_check
@njit(**KERNEL)
def project(position, rotation, eye, places):
    """Write u and v, pixels, and the depth, metres, of every point of a hand into `places`, (3, p)."""
    turn, shift = np.empty((3, 3), np.float32), np.empty(3, np.float32)
    for i in range(3):
        shift[i] = ZERO
        for j in range(3):
            turn[i, j] = ZERO
        for k in range(3):
            c = eye.rotation[k, i]
            shift[i] += c * (position[k] - eye.translation[k])
            for j in range(3):
                turn[i, j] += c * rotation[k, j]
    m00, m01, m02, m10, m11, m12 = turn[0, 0], turn[0, 1], turn[0, 2], turn[1, 0], turn[1, 1], turn[1, 2]
    m20, m21, m22, s0, s1, s2 = turn[2, 0], turn[2, 1], turn[2, 2], shift[0], shift[1], shift[2]
    fx, fy, ox, oy = eye.focal[0], eye.focal[1], eye.center[0], eye.center[1]
    points = eye.points
    for k in range(points.shape[1]):
        x, y, z = points[0, k], points[1, k], points[2, k]
        depth = m20 * x + m21 * y + m22 * z + s2
        inverse = ONE / max(depth, NEAR)
        places[0, k] = fx * (m00 * x + m01 * y + m02 * z + s0) * inverse + ox
        places[1, k] = fy * (m10 * x + m11 * y + m12 * z + s1) * inverse + oy
        places[2, k] = depth


@no_type_check
@njit(**KERNEL)
def cell(coordinate, size):
    """Along one axis: the pixel before a coordinate, the next one, the weight of that, and whether it is inside."""
    last = np.float32(size - 1)
    clipped = min(max(coordinate, ZERO), last)
    before = np.uint32(clipped)
    after = min(before + np.uint32(1), np.uint32(size - 1))
    return before, after, clipped - np.float32(before), (coordinate > ZERO) & (coordinate < last)


@no_type_check
@njit(**KERNEL)
def look_up(position, rotation, eye, evidence, start, inputs):
    """Write the evidence of hands into the columns of their inputs from `start` on.

    Args:
        position: (n, 3), metres.
        rotation: (n, 3, 3), hand to world.
        eye: Camera and points.
        evidence: What is looked up.
        start: First column.
        inputs: (n, width), written.
    """
    depth, offsets, features, window = evidence.depth, evidence.offsets, evidence.features, evidence.window
    count, scales, surfaces = eye.points.shape[1], len(evidence.scales), offsets.shape[2]
    behind = start + scales * count
    first = behind + surfaces * count
    looked = (count + evidence.every - 1) // evidence.every
    unit, per_spread, per_scale = np.float32(evidence.unit), np.float32(1 / evidence.spread), ONE / evidence.scales
    places, signed = np.empty((3, count), np.float32), np.empty(count, np.float32)
    for h in range(len(position)):
        row = inputs[h]
        project(position[h], rotation[h], eye, places)
        for k in range(count):
            left, right, a, _ = cell(places[0, k], depth.shape[1])
            top, bottom, b, _ = cell(places[1, k], depth.shape[0])
            upper = depth[top, left] + a * (depth[top, right] - depth[top, left])
            lower = depth[bottom, left] + a * (depth[bottom, right] - depth[bottom, left])
            signed[k] = places[2, k] - upper - b * (lower - upper)
        for s in range(scales):
            for k in range(count):
                row[start + s * count + k] = signed[k] * per_scale[s]
        for k in range(count):
            left, right, a, _ = cell(window[0] * places[0, k] + window[1], offsets.shape[1])
            top, bottom, b, _ = cell(window[2] * places[1, k] + window[3], offsets.shape[0])
            for c in range(surfaces):
                upper = offsets[top, left, c] + a * (offsets[top, right, c] - offsets[top, left, c])
                lower = offsets[bottom, left, c] + a * (offsets[bottom, right, c] - offsets[bottom, left, c])
                value = upper + b * (lower - upper)
                row[behind + c * count + k] = (signed[k] - unit * value) * per_spread
            if k % evidence.every == 0:
                column = first + k // evidence.every
                for c in range(features.shape[2]):
                    upper = features[top, left, c] + a * (features[top, right, c] - features[top, left, c])
                    lower = features[bottom, left, c] + a * (features[bottom, right, c] - features[bottom, left, c])
                    row[column + c * looked] = upper + b * (lower - upper)


@no_type_check
@njit(**KERNEL)
def slopes(maps, at, c):
    """Derivatives of channel c along columns and rows at a place: rows and columns of its cell, and weights."""
    top, bottom, left, right, a, b = at
    upper, lower = maps[top, right, c] - maps[top, left, c], maps[bottom, right, c] - maps[bottom, left, c]
    before, after = maps[bottom, left, c] - maps[top, left, c], maps[bottom, right, c] - maps[top, right, c]
    return upper + b * (lower - upper), before + a * (after - before)


@no_type_check
@njit(**KERNEL)
def pull_back(position, rotation, eye, evidence, start, gradient, by_pose):
    """Add what the evidence of hands contributes to a derivative in their pose.

    Args:
        position: (n, 3), metres.
        rotation: (n, 3, 3), hand to world.
        eye: Camera and points.
        evidence: What was looked up.
        start: Its first column.
        gradient: (n, width), derivatives in what `look_up` writes.
        by_pose: (n, 12), added to: derivatives in the position, then in the rotation, row by row.
    """
    depth, offsets, features, window = evidence.depth[:, :, None], evidence.offsets, evidence.features, evidence.window
    count, scales, surfaces = eye.points.shape[1], len(evidence.scales), offsets.shape[2]
    behind = start + scales * count
    first = behind + surfaces * count
    looked = (count + evidence.every - 1) // evidence.every
    unit, per_spread, per_scale = np.float32(evidence.unit), np.float32(1 / evidence.spread), ONE / evidence.scales
    places = np.empty((3, count), np.float32)
    for h in range(len(position)):
        row, out = gradient[h], by_pose[h]
        project(position[h], rotation[h], eye, places)
        for k in range(count):
            u, v, z = places[0, k], places[1, k], places[2, k]
            by_signed, by_u, by_v = ZERO, ZERO, ZERO
            for s in range(scales):
                by_signed += row[start + s * count + k] * per_scale[s]
            left, right, a, across = cell(window[0] * u + window[1], offsets.shape[1])
            top, bottom, b, along = cell(window[2] * v + window[3], offsets.shape[0])
            at = (top, bottom, left, right, a, b)
            for c in range(surfaces):
                weight = row[behind + c * count + k] * per_spread
                by_signed += weight
                by_column, by_row = slopes(offsets, at, c)
                by_u -= unit * weight * by_column
                by_v -= unit * weight * by_row
            if k % evidence.every == 0:
                for c in range(features.shape[2]):
                    weight = row[first + k // evidence.every + c * looked]
                    by_column, by_row = slopes(features, at, c)
                    by_u += weight * by_column
                    by_v += weight * by_row
            by_u, by_v = by_u * window[0] * across, by_v * window[2] * along
            left, right, a, across = cell(u, depth.shape[1])
            top, bottom, b, along = cell(v, depth.shape[0])
            by_column, by_row = slopes(depth, (top, bottom, left, right, a, b), 0)
            by_u -= by_signed * by_column * across
            by_v -= by_signed * by_row * along
            inverse = ONE / max(z, NEAR)
            by_x, by_y, by_z = by_u * eye.focal[0] * inverse, by_v * eye.focal[1] * inverse, by_signed
            if z >= NEAR:
                by_z -= (by_u * (u - eye.center[0]) + by_v * (v - eye.center[1])) * inverse
            for i in range(3):
                world = eye.rotation[i, 0] * by_x + eye.rotation[i, 1] * by_y + eye.rotation[i, 2] * by_z
                out[i] += world
                for j in range(3):
                    out[3 + 3 * i + j] += world * eye.points[j, k]
