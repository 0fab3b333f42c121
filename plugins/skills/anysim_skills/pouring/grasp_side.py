"""Grasp from the side: take hold of a standing vessel so that its opening stays free."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, MovingSkill, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.choice import Choice
from anysim_skills.grasping.grasp import CLOSING_STEPS, ROOM, Force, Metres, Offset, Speed, closed
from anysim_skills.grasping.in_fingers import InFingers
from anysim_skills.look_ahead import LookAhead
from anysim_skills.object_shapes import ObjectShapes
from anysim_skills.recovery.homing import Homing

SIDES = 4
"""The hand comes along the vessel's x or y, either way."""
SLOPES = np.array([0.2, 0.4])
"""[rad] of the hand's way below the horizontal, so that the wrist stays clear of the table."""
FINGER = 0.045
"""[m] a vessel that reaches further towards the hand than this does not fit between the fingers."""


class GraspSide(PhasedSkill):
    """Grasp the standing `object` with `robot` from one of four sides, at `offset` from its origin, and lift it."""

    first = 1

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        tool: str = "tool",
        solver: str = "numba_ik",
        offset: Offset = (0.0, 0.0, 0.0),
        clear: Metres = 0.1,
        lift: Metres = 0.1,
        speed: Speed = 0.3,
        force: Force = None,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 200,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self._press = self.arm.share_of(force)
        self._object, self._offset = object, np.array(offset)
        self._clear, self._lift, self._speed, self._late = clear, lift, speed, steps
        self._shapes, self._fingers = ObjectShapes(env.scene, object), InFingers(self.arm, object)
        n = env.num_envs
        self._choice, self._turn, self._rest = Choice(n, SIDES * len(SLOPES)), np.zeros((n, 4)), np.zeros(n)
        self._ahead = LookAhead(self.arm)
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("back off", self._open, self._backing_off, self._late),
            Phase("choose", self._choose, self._chosen, 1),
            Phase("approach", None, self._approach, self._late),
            Phase("advance", None, self._advance, self._late),
            Phase("close", self._close, self._closing, CLOSING_STEPS + 1),
            Phase("lift", self._raise, self._rising, self._late),
        )

    def foresee(self, following: MovingSkill) -> None:
        self._ahead.foresee(following)

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm).phases()

    def retry(self, rung: Rung, env: int) -> int | None:
        return self._choice.retry(rung, env)

    # ------------------------------------------------------------------ phases

    def _open(self, ids: Array, at: Array) -> None:
        self.arm.closed[ids] = False
        self.arm.command[ids] = self.arm.tool.pose[at]
        away = P.compose(self.arm.tool.pose[at], np.array([[0.0, 0.0, -self._clear, 0.0, 0.0, 0.0, 1.0]]))
        self.arm.go(ids, away, self._speed)

    def _backing_off(self, ids: Array, at: Array) -> Array:
        waiting = self.steps[ids] < 10  # the fingers open first
        self.arm.speed[ids] = np.where(waiting, 0.0, self._speed)
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1) | (self.steps[ids] >= self._late - 1), GO_ON, STAY)

    def _choose(self, ids: Array, at: Array) -> None:
        """The reachable side with the least motion, of those at which the vessel fits between the fingers."""
        self.arm.closed[ids] = False
        thing = self._object.root.pose[at]
        yaw = 2.0 * np.arctan2(thing[:, 5], thing[:, 6])[:, None, None] + (np.pi / 2 * np.arange(SIDES))[:, None]
        turns = _towards(*np.broadcast_arrays(yaw, SLOPES)).reshape(len(ids), -1, 4)
        grasps = np.concatenate([np.repeat(self._place(at)[:, None], turns.shape[1], axis=1), turns], axis=-1)
        raised = grasps + np.array([0.0, 0.0, self._lift, 0.0, 0.0, 0.0, 0.0])
        targets = np.stack([_before(grasps, self._clear), grasps, raised], axis=2)
        low, high = self._shapes.box(ids)
        wide = (high - low)[:, [1, 0, 1, 0]] > self.arm.aperture - ROOM
        deep = np.concatenate([-low[:, :2], high[:, :2]], axis=1) > FINGER  # towards a hand that comes along +x, ...
        misfits = np.repeat(wide | deep, len(SLOPES), axis=1)
        effort = self._ahead.passed(ids, at, grasps, np.where(misfits, np.inf, self.arm.effort(ids, targets)))
        self._turn[ids] = turns[np.arange(len(ids)), self._choice.choose(ids, effort)]

    def _chosen(self, ids: Array, at: Array) -> Array:
        absent = ~self._object.present[at]
        return np.where(absent, _ABSENT, np.where(self._choice.none_left(ids), _NO_IK, GO_ON))

    def _place(self, at: Array) -> Array:
        """(n, 3) where the vessel is grasped."""
        thing = self._object.root.pose[at]
        return thing[:, :3] + P.rotate(thing[:, 3:], np.broadcast_to(self._offset, (len(thing), 3)))

    def _grasp(self, ids: Array, at: Array) -> Array:
        return np.concatenate([self._place(at), self._turn[ids]], axis=1)

    def _approach(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, _before(self._grasp(ids, at), self._clear), self._speed)
        return np.where(self.arm.arrived(ids, at), GO_ON, STAY)

    def _advance(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._grasp(ids, at), self._speed / 2)
        return np.where(self.arm.arrived(ids, at), GO_ON, STAY)

    def _close(self, ids: Array, at: Array) -> None:
        del at
        self.arm.closed[ids], self.arm.press[ids] = True, self._press
        self.arm.stay(ids)

    def _closing(self, ids: Array, at: Array) -> Array:
        del at
        return self._fingers.judged(ids, closed(ids, self.steps[ids], self.arm) == GO_ON, GO_ON)

    def _raise(self, ids: Array, at: Array) -> None:
        self._rest[ids] = self._object.root.position[at, 2]
        self.arm.take(ids, at, self._object.root)
        up = np.array([0.0, 0.0, self._lift, 0.0, 0.0, 0.0, 0.0])
        self.arm.go(ids, self.arm.command[ids] + up, self._speed / 2)

    def _rising(self, ids: Array, at: Array) -> Array:
        held, there = self.arm.holds(ids, at, self._object.root), self.arm.arrived(ids, at)
        return self._fingers.kept(ids, held, np.where(there, GO_ON, STAY))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        risen = self._object.root.position[at, 2] - self._rest[env_ids] > 0.5 * self._lift
        return np.where(risen, GO_ON, _MISSED)


def _towards(yaw: Array, slope: Array) -> Array:
    """Tool orientations (..., 4): z along a heading [rad] and down by a slope [rad], y, the fingers' way, level."""
    down = P.from_axis_angle(np.broadcast_to([0.0, 1.0, 0.0], (*slope.shape, 3)), np.pi / 2 + slope)
    return P.multiply(P.from_axis_angle(np.broadcast_to([0.0, 0.0, 1.0], (*yaw.shape, 3)), yaw), down)


def _before(grasps: Array, clear: float) -> Array:
    """Tool poses (..., 7) short of grasps along their z [m]."""
    back = np.broadcast_to(np.array([0.0, 0.0, -clear, 0.0, 0.0, 0.0, 1.0]), grasps.shape)
    return P.compose(grasps, back)


_NO_IK, _ABSENT = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.ADVERSE_STATE)
_UNSTABLE, _MISSED = OUTCOMES.index(Outcome.UNSTABLE_GRASP), OUTCOMES.index(Outcome.MISSED_CONTACT)
