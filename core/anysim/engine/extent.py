"""Extent of a World: a body beyond it, or at a place that is no number, has left, and faults its env.

Only what can leave is looked at: free bodies, and links that a joint without limits slides.
"""

import numpy as np

from anysim.conventions import Array
from anysim.model.world import BodyKind, JointType, World


class Extent:
    """Looks after the bodies of a world that can leave it.

    Attributes:
        watched: their indices, as a slice where they stand side by side.
    """

    def __init__(self, world: World) -> None:
        self._world, self._extent = world, world.physics.extent
        can_leave = [body.kind is BodyKind.FREE for body in world.bodies]
        for b, body in enumerate(world.bodies):
            if body.kind is BodyKind.LINK:
                joint = world.joints[world.body_joint[b]]
                slides = joint.type is JointType.PRISMATIC and joint.upper - joint.lower > self._extent
                can_leave[b] = slides or can_leave[body.parent]
        self._bodies = [b for b, leaves in enumerate(can_leave) if leaves and not self._follows(b, can_leave)]
        first, last = (self._bodies[0], self._bodies[-1] + 1) if self._bodies else (0, 0)
        self.watched: slice | list[int] | None = None
        if self._bodies:
            self.watched = slice(first, last) if last - first == len(self._bodies) else self._bodies

    def _follows(self, b: int, can_leave: list[bool]) -> bool:
        """Whether a link stays near its parent, which is looked at."""
        body = self._world.bodies[b]
        if body.kind is not BodyKind.LINK or not can_leave[body.parent]:
            return False
        joint = self._world.joints[self._world.body_joint[b]]
        return joint.type is not JointType.PRISMATIC or joint.upper - joint.lower <= self._extent

    def with_those_outside(self, fault: Array, body_pose: Array) -> Array:
        """(N,) bool: `fault`, and the envs of which a body has left."""
        places = body_pose[:, self.watched, :3]
        low, high = np.minimum.reduce(places, axis=None), np.maximum.reduce(places, axis=None)
        if -self._extent <= low and high <= self._extent:  # false for what is no number
            return fault
        return fault | ~(np.abs(places) <= self._extent).all(axis=(1, 2))

    def reason(self, body_pose: Array, time: float) -> str:
        """A sentence for an env (B, 7) of which a body has left; empty if none has."""
        for b in self._bodies:
            place = body_pose[b, :3]
            if (np.abs(place) <= self._extent).all():
                continue
            where = ", ".join(f"{value:.4g}" for value in place)
            what = f"'{self._world.bodies[b].name}'"
            if not np.isfinite(place).all():
                return f"{what} is at a place that is no number ({where}) at {time:.3f} s: the simulation has diverged"
            return (
                f"{what} has left the world at {time:.3f} s: it is at ({where}) m, beyond {self._extent:g} m from the "
                f"origin (physics.extent)"
            )
        return ""
