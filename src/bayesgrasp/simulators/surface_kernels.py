"""Compiled loops that draw the surface in a depth image from another viewpoint.

Neighbouring pixels whose depths belong together span triangles; the triangles are drawn with a depth buffer. Unlike
points, triangles leave no gaps where the new view is closer, and unlike blurred points they never join two surfaces.
"""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def draw_triangle(u, v, key, buffer):
    """Draw one triangle: raise the buffer at the pixels inside to the key, which is linear over the triangle."""
    area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
    if area == 0:
        return
    height, width = buffer.shape
    top, bottom = max(0, int(np.ceil(v.min()))), min(height - 1, int(np.floor(v.max())))
    left, right = max(0, int(np.ceil(u.min()))), min(width - 1, int(np.floor(u.max())))
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            b = ((column - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (row - v[0])) / area
            c = ((u[1] - u[0]) * (row - v[0]) - (column - u[0]) * (v[1] - v[0])) / area
            if b >= -1e-9 and c >= -1e-9 and b + c <= 1 + 1e-9:
                value = key[0] + b * (key[1] - key[0]) + c * (key[2] - key[0])
                if value > buffer[row, column]:
                    buffer[row, column] = value


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def draw_surface(depth, returned, u, v, key, slope, offset, front, back):
    """Draw the surface of an image, and what bounds the space that it hides.

    Args:
        depth: Image the surface is taken from, metres, 0 = nothing there.
        returned: Whether a depth was measured; others only bound hidden space.
        u: Column of each of its pixels in the buffers; NaN for nowhere.
        v: Row of each of its pixels in the buffers.
        key: What is drawn, larger in front; it must be linear in (u, v) over a plane (inverse depth for a camera,
            height for a map).
        slope: Depths z of one surface may differ by slope * z + offset within a triangle.
        offset: In metres.
        front: Buffer of the surface, seen from the side that the image shows; starts at the smallest key of interest.
        back: Buffer of the surface seen from behind, and of the curtains from its edges to the background.
    """
    corners = np.empty((4, 4))
    for row in range(depth.shape[0] - 1):
        for column in range(depth.shape[1] - 1):
            for k in range(4):
                r, c = row + k // 2, column + k % 2
                corners[0, k], corners[1, k] = u[r, c], v[r, c]
                corners[2, k], corners[3, k] = key[r, c], depth[r, c]
            for first in range(2):
                x, y, top, z = corners[:, first : first + 3]
                if z.min() <= 0 or np.isnan(x.sum()):
                    continue
                turn = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
                measured = (
                    returned[row, column + 1] and returned[row + 1, column] and returned[row + first, column + first]
                )
                if z.max() - z.min() > slope * z.min() + offset or (turn > 0) != (first == 0):
                    draw_triangle(x, y, top, back)
                elif measured:
                    draw_triangle(x, y, top, front)
