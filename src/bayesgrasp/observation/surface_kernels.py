"""Compiled loops that draw the surface in a depth image from another viewpoint.

Neighbouring pixels whose depths belong together span triangles; the triangles are drawn with a depth buffer. Unlike
points, triangles leave no gaps where the new view is closer, and unlike blurred points they never join two surfaces.
What is a pixel thin, as the rim of a cup from above, spans no triangle; its pixels are drawn as points.
"""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def draw_triangle(first, second, third, buffer):
    """Draw one triangle: raise the buffer at the pixels inside to the key, which is linear over the triangle.

    Args:
        first: A corner: column, row and key.
        second: Another one.
        third: The last one.
        buffer: What is drawn into.
    """
    (u0, v0, key0), (u1, v1, key1), (u2, v2, key2) = first, second, third
    height, width = buffer.shape
    top, bottom = max(0.0, np.ceil(min(v0, v1, v2))), min(height - 1.0, np.floor(max(v0, v1, v2)))
    left, right = max(0.0, np.ceil(min(u0, u1, u2))), min(width - 1.0, np.floor(max(u0, u1, u2)))
    area = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
    if top > bottom or left > right or area == 0:
        return
    b_column, b_row, c_column, c_row = (v2 - v0) / area, (u0 - u2) / area, (v0 - v1) / area, (u1 - u0) / area
    for row in range(int(top), int(bottom) + 1):
        for column in range(int(left), int(right) + 1):
            b = (column - u0) * b_column + (row - v0) * b_row
            c = (column - u0) * c_column + (row - v0) * c_row
            if b >= -1e-9 and c >= -1e-9 and b + c <= 1 + 1e-9:
                value = key0 + b * (key1 - key0) + c * (key2 - key0)
                if value > buffer[row, column]:
                    buffer[row, column] = value


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def draw_surface(depth, returned, places, allowance, front, back):
    """Draw the surface of an image, and what bounds the space that it hides.

    Args:
        depth: Image the surface is taken from, metres, 0 = nothing there.
        returned: Whether a depth was measured; others only bound hidden space.
        places: Column u (NaN for nowhere) and row v of each of its pixels in the buffers, and the key: what is drawn,
            larger in front; it must be linear in (u, v) over a plane, as inverse depth is.
        allowance: Slope and offset (m): depths z of one surface may differ by slope * z + offset within a triangle.
        front: Buffer of the surface, seen from the side that the image shows; starts at the smallest key of interest.
        back: Buffer of the surface seen from behind, and of the curtains from its edges to the background.
    """
    (u, v, key), (slope, offset) = places, allowance
    covered = np.zeros(depth.shape, np.bool_)
    for row in range(depth.shape[0] - 1):
        for column in range(depth.shape[1] - 1):
            # Both triangles of a square of pixels share the corners 1 (to the right) and 2 (below).
            z1, z2 = depth[row, column + 1], depth[row + 1, column]
            if not (z1 > 0 and z2 > 0):
                continue
            right = u[row, column + 1], v[row, column + 1], key[row, column + 1]
            below = u[row + 1, column], v[row + 1, column], key[row + 1, column]
            measured = returned[row, column + 1] and returned[row + 1, column]
            for step in range(2):
                i, j = row + step, column + step
                z0, corner = depth[i, j], (u[i, j], v[i, j], key[i, j])
                if not z0 > 0 or np.isnan(corner[0] + right[0] + below[0]):
                    continue
                # The second triangle is listed the other way round.
                turn = (right[0] - corner[0]) * (below[1] - corner[1]) - (below[0] - corner[0]) * (right[1] - corner[1])
                nearest = min(z0, z1, z2)
                torn = max(z0, z1, z2) - nearest > slope * nearest + offset
                if measured and returned[i, j] and not torn:
                    covered[i, j] = covered[row, column + 1] = covered[row + 1, column] = True
                if torn or (turn > 0) != (step == 0):
                    draw_triangle(corner, right, below, back)
                elif measured and returned[i, j]:
                    draw_triangle(corner, right, below, front)
    draw_thin(depth, returned & ~covered, places, allowance, front)


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def draw_thin(depth, alone, places, allowance, front):
    """Draw pixels that belong to no triangle as points, where a neighbour of the same surface says they are no noise.

    Args:
        depth: See `draw_surface`.
        alone: The pixels.
        places: See `draw_surface`.
        allowance: See `draw_surface`.
        front: See `draw_surface`.
    """
    (u, v, key), (slope, offset) = places, allowance
    for row in range(1, depth.shape[0] - 1):
        for column in range(1, depth.shape[1] - 1):
            if not alone[row, column] or np.isnan(u[row, column]):
                continue
            z, company = depth[row, column], 0
            for i in range(row - 1, row + 2):
                for j in range(column - 1, column + 2):
                    company += alone[i, j] and abs(depth[i, j] - z) <= slope * z + offset
            at, beside = int(np.rint(v[row, column])), int(np.rint(u[row, column]))
            if company > 1 and 0 <= at < front.shape[0] and 0 <= beside < front.shape[1]:
                front[at, beside] = max(front[at, beside], key[row, column])
