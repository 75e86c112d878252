"""Compiled distances of points from a hand of rounded boxes.

A rounded box of half extents e and radius r (a box for r = 0, a capsule for e = (0, 0, half length)) has, with
q = |p| - e in its own frame, the signed distance

    |max(q, 0)| + min(max(q_x, q_y, q_z), 0) - r.
"""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def least_distance(points, centers, rotations, extents, radii, bounds, distances):
    """Signed distance of each point from the nearest of the shapes.

    Args:
        points: (n, 3), metres, in the frame of the hand.
        centers: (s, 3), of the shapes.
        rotations: (s, 3, 3), shape to hand.
        extents: (s, 3), half extents.
        radii: (s,).
        bounds: (s,), radii of balls around the centres that contain the shapes.
        distances: (n,), written.
    """
    for i in range(len(points)):
        best = np.inf
        for s in range(len(centers)):
            x, y, z = points[i, 0] - centers[s, 0], points[i, 1] - centers[s, 1], points[i, 2] - centers[s, 2]
            far = best + bounds[s]
            if far > 0 and x * x + y * y + z * z < far * far:
                r = rotations[s]
                qx = abs(r[0, 0] * x + r[1, 0] * y + r[2, 0] * z) - extents[s, 0]
                qy = abs(r[0, 1] * x + r[1, 1] * y + r[2, 1] * z) - extents[s, 1]
                qz = abs(r[0, 2] * x + r[1, 2] * y + r[2, 2] * z) - extents[s, 2]
                outside = np.sqrt(max(qx, 0.0) ** 2 + max(qy, 0.0) ** 2 + max(qz, 0.0) ** 2)
                best = min(best, outside + min(max(qx, qy, qz), 0.0) - radii[s])
        distances[i] = best
