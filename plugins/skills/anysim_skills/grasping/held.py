"""Skills that end with a held object out of the hand: how it is kept in sight, and let go of."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView
from anysim_skills.arm import Arm
from anysim_skills.grasping.release import OPENING_STEPS
from anysim_skills.recovery.homing import Homing, still_held

RAISED = np.array([0.0, 0.0, 0.03, 0.0, 0.0, 0.0, 0.0])
"""[m] up from what it stands on an object is brought before its way is planned."""
TURNS = np.pi / 2 * np.arange(4)
"""[rad] about the vertical that an object which is brought somewhere may be turned by."""
RESTING = 0.03
"""[m/s, rad/s] what moves slower has come to rest."""


class Moves(NamedTuple):
    """The moves of such a skill: speeds [m/s] of the tool, the way up afterwards [m], control steps a move may take."""

    speed: float
    lower_speed: float
    retreat: float
    steps: int


def turned_about(tool: Array, thing: Array, place: Array) -> Array:
    """Tool poses (n, G, 7) that bring a held thing (n, 3) to a place (n, 3), of tools (n, 7): turned by each of TURNS.

    The first is not turned.
    """
    turns = np.zeros((1, len(TURNS), 4))
    turns[0, :, 2], turns[0, :, 3] = np.sin(TURNS / 2), np.cos(TURNS / 2)
    turns = np.repeat(turns, len(tool), axis=0)
    offset = np.repeat((tool[:, :3] - thing)[:, None], len(TURNS), axis=1)
    rotation = P.multiply(turns, np.repeat(tool[:, None, 3:], len(TURNS), axis=1))
    return np.concatenate([place[:, None] + P.rotate(turns, offset), rotation], axis=-1)


class PutsDown(PhasedSkill):
    """A skill that begins with `object` in the hand of `arm` and puts it somewhere."""

    def __init__(self, env: TaskEnv, arm: Arm, object: ObjectView, moves: Moves) -> None:
        self.arm, self.object, self.moves = arm, object, moves
        self._up = np.array([0.0, 0.0, moves.retreat, 0.0, 0.0, 0.0, 0.0])
        self._away = np.zeros((env.num_envs, 7))
        super().__init__(env, [arm])

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, opens=False, held=self.object).phases()

    def recovers(self, env: int, failure: Outcome) -> bool:
        return still_held(self.arm, env, failure)

    def take(self, ids: Array, at: Array) -> None:
        """The object is held as it is now."""
        self.arm.take(ids, at, self.object.root)

    def held(self, ids: Array, at: Array, said: Array) -> Array:
        """(n,) what is said, or that the object is not held any more."""
        return np.where(self.arm.holds(ids, at, self.object.root), said, _UNSTABLE)

    def slow(self, at: Array, speed: float) -> Array:
        """(n,) bool: the object moves slower than that [m/s]."""
        return P.norm(self.object.root.twist[at, :3]) < speed

    def let_go(self) -> tuple[Phase, Phase]:
        """Open the fingers, and up from there."""
        return (
            Phase("open", self._open, self._opening, OPENING_STEPS + 1),
            Phase("retreat", self._retreat, self._retreating, self.moves.steps),
        )

    def _open(self, ids: Array, at: Array) -> None:
        pose = self.arm.tool.pose[at]
        self.arm.command[ids] = pose  # the press ends with the grip
        self.arm.go(ids, pose, self.moves.lower_speed)
        self.arm.closed[ids] = False
        self._away[ids] = pose + self._up

    def _opening(self, ids: Array, at: Array) -> Array:
        del at
        still = (self.steps[ids] >= 5) & (self.arm.finger_speed(ids) < RESTING)
        return np.where(still | (self.steps[ids] >= OPENING_STEPS), GO_ON, STAY)

    def _retreat(self, ids: Array, at: Array) -> None:
        del at
        self.arm.go(ids, self._away[ids], self.moves.speed / 2)

    def _retreating(self, ids: Array, at: Array) -> Array:
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY)


_UNSTABLE = OUTCOMES.index(Outcome.UNSTABLE_GRASP)
