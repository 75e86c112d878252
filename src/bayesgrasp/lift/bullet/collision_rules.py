"""Which bodies of a compiled MuJoCo model may collide, by MuJoCo's own rules, for an engine that has others."""

from __future__ import annotations

import mujoco


class CollisionRules:
    """Bodies collide unless they are one rigid body, parent and child, or a pair that the model excludes.

    Bodies without a joint between them are one rigid body; MuJoCo calls the first of them their weld. Children of the
    world collide with what stands still in it.

    Args:
        model: The model.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._weld, self._parent = model.body_weldid.tolist(), model.body_parentid.tolist()
        # A signature is the numbers of both bodies in 16 bits each.
        self._excluded = {(s >> 16, s & 0xFFFF) for s in model.exclude_signature.tolist()}

    def allow(self, first: int, second: int) -> bool:
        """Whether two bodies may collide."""
        one, other = self._weld[first], self._weld[second]
        if one == other or (first, second) in self._excluded or (second, first) in self._excluded:
            return False
        above, below = self._weld[self._parent[one]], self._weld[self._parent[other]]
        return not ((one != 0 and one == below) or (other != 0 and other == above))
