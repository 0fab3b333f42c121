"""DragDown: press the closed fingers onto the top of an object, and drag it across its support by friction."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.choice import Choice
from anysim_skills.grasping.candidates import TOP_DOWN, from_above
from anysim_skills.grasping.grasp import CLOSING_STEPS, Metres, Speed
from anysim_skills.moving.push import level_way
from anysim_skills.object_shapes import ObjectShapes
from anysim_skills.recovery.homing import Homing

AHEAD = 0.01
"""[m] that the command is before the object at most."""
STALLED = 60
"""Control steps in which the object does not get nearer by `PROGRESS` before the fingers count as slipping on it."""
PROGRESS = 0.004
"""[m]"""


class DragDown(PhasedSkill):
    """Drag `object` to `goal`, horizontally, by the friction of closed fingers that `robot` presses onto its top.

    For what is too wide or too flat to be grasped. The fingers must rub more on it than it does on its support, by the
    more the less they press: where they slip, the skill ends with `lost`.
    """

    first = 1

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        press: Annotated[
            float, Field(gt=0, description="[m] that the command is below the fingers: how hard they press")
        ] = 0.004,
        tolerance: Metres = 0.01,
        hover: Metres = 0.08,
        speed: Speed = 0.3,
        drag_speed: Speed = 0.06,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 400,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self._object, self._goal, self._press, self._tolerance = object, goal, press, tolerance
        self._hover, self._speed, self._drag_speed, self._late = hover, speed, drag_speed, steps
        n = env.num_envs
        self._shapes, self._choice = ObjectShapes(env.scene, object), Choice(n, TOP_DOWN)
        self._turn, self._spot = np.zeros((n, 4)), np.zeros((n, 3))
        """The hand's orientation, and where on the object it presses, in its frame."""
        self._left, self._since = np.zeros(n), np.zeros(n, dtype=np.int64)
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("rise", self._rise, self._rising, self._late),
            Phase("choose", self._choose, self._chosen, 1),
            Phase("approach", None, self._approach, self._late),
            Phase("press", None, self._pressing, self._late),
            Phase("drag", self._touch, self._drag, 3 * self._late),
            Phase("retreat", self._rise, self._rising, self._late),
        )

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, opens=False).phases()

    def retry(self, rung: Rung, env: int) -> int | None:
        return self._choice.retry(rung, env, same=(Rung.RESAMPLE, Rung.BACK_OFF))

    def _top(self, ids: Array, at: Array) -> Array:
        """(n, 3) the middle of the object's top."""
        thing = self._object.root.pose[at]
        low, high = self._shapes.box(ids)
        top = thing[:, :3] + P.rotate(thing[:, 3:], 0.5 * (low + high))
        top[:, 2] += 0.5 * (high - low)[:, 2]
        return top

    def _rise(self, ids: Array, at: Array) -> None:
        pose = self.arm.tool.pose[at]
        self.arm.command[ids] = pose
        self.arm.go(ids, pose + np.array([0.0, 0.0, self._hover, 0.0, 0.0, 0.0, 0.0]), self._speed)

    def _rising(self, ids: Array, at: Array) -> Array:
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY)

    def _choose(self, ids: Array, at: Array) -> None:
        """The turn of the hand with the least motion over the object, on it, and at the goal."""
        self.arm.closed[ids] = True
        poses, top = from_above(self._object.root.pose[at]), self._top(ids, at)
        poses[..., :3] = top[:, None]
        over, there = poses.copy(), poses.copy()
        over[..., 2] += self._hover
        there[..., :3] += level_way(self._object, self._goal, at)[:, None]
        chosen = self._choice.least_motion(self.arm, ids, np.stack([over, poses, there], axis=2))
        self._turn[ids] = poses[np.arange(len(ids)), chosen, 3:]

    def _chosen(self, ids: Array, at: Array) -> Array:
        absent = ~self._object.present[at]
        return np.where(absent, _ABSENT, np.where(self._choice.none_left(ids), _NO_IK, GO_ON))

    def _approach(self, ids: Array, at: Array) -> Array:
        over = self._top(ids, at) + np.array([0.0, 0.0, self._hover])
        self.arm.go(ids, np.concatenate([over, self._turn[ids]], axis=1), self._speed)
        return np.where(self.arm.arrived(ids, at) & (self.steps[ids] >= CLOSING_STEPS), GO_ON, STAY)

    def _pressing(self, ids: Array, at: Array) -> Array:
        down = self._top(ids, at) - np.array([0.0, 0.0, 2 * self._press])
        self.arm.go(ids, np.concatenate([down, self._turn[ids]], axis=1), self._speed / 4, self._press)
        return np.where((self.steps[ids] >= 10) & self.arm.touching(ids, at), GO_ON, STAY)

    def _touch(self, ids: Array, at: Array) -> None:
        thing = self._object.root.pose[at]
        self._spot[ids] = P.rotate_inverse(thing[:, 3:], self.arm.tool.position[at] - thing[:, :3])
        self._left[ids], self._since[ids] = np.inf, 0

    def _drag(self, ids: Array, at: Array) -> Array:
        """The tool goes ahead of where it pressed at first, by a bounded way, and stays pressed down."""
        way, thing = level_way(self._object, self._goal, at), self._object.root.pose[at]
        left = P.norm(way)
        target = thing[:, :3] + P.rotate(thing[:, 3:], self._spot[ids])
        target += way * np.minimum(1.0, AHEAD / np.maximum(left, 1e-9))[:, None]
        target[:, 2] -= self._press
        lead = 2.0 * (AHEAD + self._press)  # the target is bounded by the object itself
        self.arm.go(ids, np.concatenate([target, self._turn[ids]], axis=1), self._drag_speed, lead)
        on = left < self._left[ids] - PROGRESS
        self._left[ids] = np.where(on, left, self._left[ids])
        self._since[ids] = np.where(on, 0, self._since[ids] + 1)
        said = np.where(self._since[ids] > STALLED, _LOST, STAY)
        return np.where(left < self._tolerance, GO_ON, said)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        del env_ids
        return np.where(P.norm(level_way(self._object, self._goal, at)) < 2 * self._tolerance, GO_ON, _LOST)


_NO_IK, _ABSENT = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.ADVERSE_STATE)
_LOST = OUTCOMES.index(Outcome.LOST)
