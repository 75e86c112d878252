"""Compiled choice of full turns: solvers give joint angles up to multiples of 2 pi, and joints have limits."""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit


@no_type_check
@njit(cache=True, nogil=True, error_model="numpy")
def nearest_turns(branches, near, limits):
    """Of each angle the turn nearest to a reference or, beyond a limit, one back; branches nearest to it first.

    Args:
        branches: (n, joints), radians.
        near: (joints,), the reference.
        limits: (joints,), largest |angle|.

    Returns:
        (m, joints), without branches that have no angles within the limits; in order of the largest joint motion, and
        those of the same motion in the order in which they were given.
    """
    count, joints = branches.shape
    chosen, motions = np.empty((count, joints)), np.empty(count)
    found = 0
    for row in range(count):
        angles, motion, inside = np.empty(joints), 0.0, True
        for j in range(joints):
            q = near[j] + (branches[row, j] - near[j] + np.pi) % (2.0 * np.pi) - np.pi
            if abs(q) > limits[j]:
                q -= np.copysign(2.0 * np.pi, q)
            inside &= abs(q) <= limits[j]
            angles[j], motion = q, max(motion, abs(q - near[j]))
        if inside:
            place = found
            while place > 0 and motions[place - 1] > motion:
                chosen[place], motions[place] = chosen[place - 1], motions[place - 1]
                place -= 1
            chosen[place], motions[place] = angles, motion
            found += 1
    return chosen[:found].copy()
