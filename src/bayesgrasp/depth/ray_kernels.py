"""Compiled loops from a view of an object to what every pixel sees: which rays to cast, and their exact depths.

All of it happens in the object frame at scale 1. The ray of pixel (u, v) is o + z M (u, v, 1), with z the depth in
metres. A point on the plane n . p = c is seen at inverse depth

    1 / z = n . M (u, v, 1) / (c - n . o),

which is affine in (u, v). The table is the plane z = 0 in this frame too, so it needs no rays. An object can appear
only inside the convex outline of its projected hull, and its shadow only inside the outline of hull and shadow.
"""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit

from bayesgrasp.depth.frame import TABLE, Region

NOWHERE = (0, 0, 0, 0)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def inverse_depth_at(view, planes, plane, u, v):
    """1 / depth of plane `plane` (`TABLE` for the table) along the ray of pixel (u, v)."""
    m, o = view.ray_matrix, view.origin
    dz = m[2, 0] * u + m[2, 1] * v + m[2, 2]
    if plane == TABLE:
        return -dz / o[2]
    dx = m[0, 0] * u + m[0, 1] * v + m[0, 2]
    dy = m[1, 0] * u + m[1, 1] * v + m[1, 2]
    a, b, c = planes[plane, 0], planes[plane, 1], planes[plane, 2]
    return (a * dx + b * dy + c * dz) / (planes[plane, 3] - (a * o[0] + b * o[1] + c * o[2]))


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def cosine_at(view, planes, plane, u, v):
    """Cosine of the tilt: between the normal of a plane, turned to the camera, and the ray of pixel (u, v)."""
    if plane == TABLE:
        return table_cosine(view, u, v)
    m = view.ray_matrix
    dx = m[0, 0] * u + m[0, 1] * v + m[0, 2]
    dy = m[1, 0] * u + m[1, 1] * v + m[1, 2]
    dz = m[2, 0] * u + m[2, 1] * v + m[2, 2]
    along = planes[plane, 0] * dx + planes[plane, 1] * dy + planes[plane, 2] * dz
    return abs(along) / np.sqrt(dx * dx + dy * dy + dz * dz)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def table_cosine(view, u, v):
    """`cosine_at` for the table."""
    m = view.ray_matrix
    dx = m[0, 0] * u + m[0, 1] * v + m[0, 2]
    dy = m[1, 0] * u + m[1, 1] * v + m[1, 2]
    dz = m[2, 0] * u + m[2, 1] * v + m[2, 2]
    return abs(dz) / np.sqrt(dx * dx + dy * dy + dz * dz)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def project_hull(view, hull, with_shadow):
    """Pixels (u, v) of the hull, then of its shadow on the table; and whether all of them are before the camera."""
    inverse, o, light = np.linalg.inv(view.ray_matrix), view.origin, view.second_eye
    count = len(hull)
    pixels = np.empty((2 * count if with_shadow else count, 2))
    in_front = True
    for i in range(len(pixels)):
        x, y, z = hull[i % count, 0], hull[i % count, 1], hull[i % count, 2]
        if i >= count:
            stretch = max(light[2] / max(light[2] - z, 1e-3), 1.0)  # below the table there is no shadow on it
            in_front = in_front and light[2] - z > 1e-3
            x, y, z = light[0] + (x - light[0]) * stretch, light[1] + (y - light[1]) * stretch, min(z, 0.0)
        x, y, z = x - o[0], y - o[1], z - o[2]
        depth = inverse[2, 0] * x + inverse[2, 1] * y + inverse[2, 2] * z
        in_front = in_front and depth > 1e-2
        pixels[i, 0] = (inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z) / depth
        pixels[i, 1] = (inverse[1, 0] * x + inverse[1, 1] * y + inverse[1, 2] * z) / depth
    return pixels, in_front


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def outline(points):
    """Corners of the convex outline of points (n, 2), in order (Andrew's monotone chain)."""
    order = np.argsort(points[:, 0])
    chain = np.empty((2 * len(points) + 1, 2))
    size = 0
    for half in range(2):
        start = size
        for i in range(len(order)):
            p = points[order[i if half == 0 else len(order) - 1 - i]]
            while size - start >= 2:
                a, b = chain[size - 2], chain[size - 1]
                if (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0:
                    break
                size -= 1
            chain[size] = p
            size += 1
    return chain[:size]


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def row_spans(corners, height, width):
    """First column and one past the last of every row in a convex outline and one pixel around it, (height, 2)."""
    low, high = np.full(height, np.inf), np.full(height, -np.inf)
    for i in range(len(corners)):
        a, b = corners[i], corners[(i + 1) % len(corners)]
        if a[1] > b[1]:
            a, b = b, a
        first, last = max(a[1], 0.0), min(b[1], height - 1.0)
        for row in range(int(np.floor(first)), min(height - 1, int(np.ceil(last))) + 1):
            at = min(max((row - a[1]) / max(b[1] - a[1], 1e-9), 0.0), 1.0)
            u = a[0] + at * (b[0] - a[0])
            low[row], high[row] = min(low[row], u - 1.0), max(high[row], u + 1.0)
    spans = np.zeros((height, 2), np.int64)
    for row in range(height):
        if high[row] >= 0 and low[row] <= width - 1:
            spans[row, 0] = max(0, int(np.floor(max(low[row], 0.0))))
            spans[row, 1] = min(width, int(np.ceil(min(high[row], float(width)))) + 1)
    return spans


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def widened(spans, margin, width):
    """The spans of all pixels within `margin` rows and columns of the given spans."""
    wide = np.zeros_like(spans)
    for row in range(len(spans)):
        left, right = width, -1
        for near in range(max(0, row - margin), min(len(spans), row + margin + 1)):
            if spans[near, 1] > spans[near, 0]:
                left, right = min(left, spans[near, 0]), max(right, spans[near, 1])
        if right > left:
            wide[row, 0], wide[row, 1] = max(0, left - margin), min(width, right + margin)
    return wide


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def bounding_box(spans, width):
    """(first row, end row, first column, end column) of the spans; `NOWHERE` if they are empty."""
    top, bottom, left, right = len(spans), -1, width, 0
    for row in range(len(spans)):
        if spans[row, 1] > spans[row, 0]:
            top, bottom = min(top, row), row
            left, right = min(left, spans[row, 0]), max(right, spans[row, 1])
    return (top, bottom + 1, left, right) if bottom >= 0 else NOWHERE


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def primary_rays(view, spans):
    """Origins and directions (object frame, float32) of the rays of all pixels in the spans, row by row."""
    count = 0
    for row in range(len(spans)):
        count += spans[row, 1] - spans[row, 0]
    m, o = view.ray_matrix, view.origin
    origins, directions = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    i = 0
    for row in range(len(spans)):
        for column in range(spans[row, 0], spans[row, 1]):
            for k in range(3):
                origins[i, k] = o[k]
                directions[i, k] = m[k, 0] * column + m[k, 1] * row + m[k, 2]
            i += 1
    return origins, directions


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def resolve(view, planes, spans, hits, box):
    """The `Region` of a box: triangles that were hit, unless the table is in front, and the table elsewhere."""
    top, bottom, left, right = box
    plane = np.full((bottom - top, right - left), TABLE, np.int32)
    inverse_depth = np.empty(plane.shape)
    for row in range(top, bottom):
        for column in range(left, right):
            inverse_depth[row - top, column - left] = inverse_depth_at(view, planes, TABLE, column, row)
    i = 0
    for row in range(len(spans)):
        for column in range(spans[row, 0], spans[row, 1]):
            if hits[i] >= 0:
                seen = inverse_depth_at(view, planes, hits[i], column, row)
                if seen > inverse_depth[row - top, column - left]:
                    inverse_depth[row - top, column - left] = seen
                    plane[row - top, column - left] = hits[i]
            i += 1
    return Region(top, left, plane, inverse_depth)
