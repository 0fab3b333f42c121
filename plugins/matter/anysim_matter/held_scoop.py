"""A scoop in a robot's hand: where the hand is when the scoop's front edge is somewhere, and what is in the scoop."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY
from anysim.task.scene import ObjectView
from anysim.task.slot_frames import CategoryView
from anysim_skills.arm import Arm
from anysim_skills.object_shapes import ObjectShapes

HEADINGS = 16
"""Directions about the vertical that are tried."""
Metres = Annotated[float, Field(gt=0, description="[m]")]
Steps = Annotated[int, Field(ge=1, description="control steps that a move may take")]
Speed = Annotated[float, Field(gt=0, description="[m/s] of the tool")]


class HeldScoop:
    """A scoop whose z goes up out of its opening and its x to its front, whose edge is `front` [m] before its origin.

    Functions take envs (n,) and their rows in the scene (n,).
    """

    def __init__(self, arm: Arm, thing: ObjectView, contents: CategoryView, front: float) -> None:
        self.arm, self.thing, self._contents, self._front = arm, thing, contents, front
        self._shapes = ObjectShapes(arm.env.scene, thing)
        self._grip = np.zeros((arm.env.num_envs, 7))
        """(N, 7) the tool in its frame."""

    def take(self, ids: Array, at: Array) -> None:
        """It is held as it is now."""
        self.arm.take(ids, at, self.thing.root)
        self._grip[ids] = P.compose(P.inverse(self.thing.root.pose[at]), self.arm.tool.pose[at])

    def tools(self, ids: Array, heading: Array, edge: Array, tilt: float) -> Array:
        """(n, g, 7) tools that hold it with its front edge at (n, g, 3), tilted down [rad] along headings (n, g)."""
        up = np.broadcast_to([0.0, 0.0, 1.0], edge.shape)
        ahead = P.from_axis_angle(up, heading)
        down = P.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.array(tilt))
        turn = P.multiply(ahead, np.broadcast_to(down, ahead.shape))
        front = np.broadcast_to([self._front, 0.0, 0.0], edge.shape)
        scoop = np.concatenate([edge - P.rotate(turn, front), turn], axis=-1)
        return P.compose(scoop, np.broadcast_to(self._grip[ids][:, None], scoop.shape))

    def loaded(self, ids: Array, at: Array) -> Array:
        """(n,) how many of the contents are in it."""
        low, high = (corner.copy() for corner in self._shapes.box(ids))
        low[:, 0], high[:, 0] = -self._front, self._front
        return inside(self._contents, at, self.thing.root.pose[at], low, high).sum(axis=1)

    def went(self, ids: Array, at: Array, within: float, late: Array | bool = False) -> Array:
        """(n,) GO_ON where the tool is so near to its target [m], or it is too late for that; the scoop is held."""
        there = self.arm.arrived(ids, at, within, 0.1) | late
        return np.where(self.arm.holds(ids, at, self.thing.root), np.where(there, GO_ON, STAY), _UNSTABLE)

    def rise(self, ids: Array, at: Array, height: Array, speed: float) -> Array:
        """(n,) as `went`, of the tool on its way straight up to heights (n,) [m], so that nothing is swept away."""
        up = self.arm.command[ids].copy()
        up[:, 2] = np.maximum(up[:, 2], height)
        self.arm.go(ids, up, speed)
        return self.went(ids, at, 0.02)


def inside(contents: CategoryView, at: Array, frame: Array, low: Array, high: Array) -> Array:
    """(n, P) bool: which of the contents, in rows of the scene, are between corners (n, 3) [m] in frames (n, 7)."""
    place = contents.positions[at]
    turn = np.broadcast_to(frame[:, None, 3:], (*place.shape[:-1], 4))
    seen = P.rotate_inverse(turn, place - frame[:, None, :3])
    there = ((seen >= low[:, None]) & (seen <= high[:, None])).all(axis=2)
    return there & contents.present[at]


_UNSTABLE = OUTCOMES.index(Outcome.UNSTABLE_GRASP)
