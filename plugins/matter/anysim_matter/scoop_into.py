"""Emptying of a scoop: it is carried over a vessel and tilted until what is in it has slid out over its front."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView, RobotView
from anysim.task.slot_frames import CategoryView
from anysim_matter.held_scoop import HEADINGS, HeldScoop, Metres, Speed, Steps
from anysim_skills.arm import Arm
from anysim_skills.choice import Choice
from anysim_skills.object_shapes import ObjectShapes

DRAINING = 60
"""Control steps, fully tilted, in which what is left in it slides out."""


class ScoopInto(PhasedSkill):
    """Empty the held `scoop` over its front into the object `into`.

    Its front edge, `front` before its origin, goes over the middle of `into`, `above` its rim, and stays there while
    the scoop is tilted by `angle`. What counts is that at most `left` of the contents are in it at the end.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        scoop: ObjectView,
        into: ObjectView,
        contents: CategoryView,
        front: Metres,
        carried: Annotated[float, Field(ge=0, lt=0.6, description="[rad] its front is up on the way")] = 0.15,
        above: Metres = 0.04,
        angle: Annotated[float, Field(gt=0, lt=2.6, description="[rad]")] = 1.1,
        left: Annotated[int, Field(ge=0, description="of the contents that may be left in the scoop")] = 3,
        tool: str = "tool",
        solver: str = "numba_ik",
        speed: Speed = 0.2,
        steps: Steps = 300,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self._held = HeldScoop(self.arm, scoop, contents, front)
        self._into, self._shapes = into, ObjectShapes(env.scene, into)
        self._carried, self._above, self._angle, self._left, self._speed, self._late = (
            carried,
            above,
            angle,
            left,
            speed,
            steps,
        )
        n = env.num_envs
        self._choice = Choice(n, HEADINGS)
        self._heading, self._edge = np.zeros(n), np.zeros((n, 3))
        """(N, …) [rad] where its front points to, and where its edge is [m]."""
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("choose", self._choose, self._chosen, 1),
            Phase("rise", None, self._rise, self._late),
            Phase("carry", None, self._carry, self._late),
            Phase("tilt", None, self._tilting, self._late),
            Phase("drain", None, self._drain, DRAINING + 1),
            Phase("level", None, self._carry, self._late),
        )

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def retry(self, rung: Rung, env: int) -> int | None:
        """Once more where too much is left in it; another direction where the arm did not come along the first."""
        again = rung is Rung.RESAMPLE or (rung is Rung.CANDIDATE and self._choice.next(env))
        return 0 if again else None

    def _choose(self, ids: Array, at: Array) -> None:
        """The heading along which the arm moves least."""
        self._held.take(ids, at)
        low, high = self._shapes.box(ids)
        into = self._into.root.pose[at]
        edge = into[:, :3] + P.rotate(into[:, 3:], 0.5 * (low + high))
        edge[:, 2] = into[:, 2] + high[:, 2] + self._above
        self._edge[ids] = edge
        heading = np.broadcast_to(2 * np.pi / HEADINGS * np.arange(HEADINGS), (len(ids), HEADINGS))
        edges = np.broadcast_to(edge[:, None], (*heading.shape, 3))
        ways = [self._held.tools(ids, heading, edges, tilt) for tilt in (-self._carried, 0.0, self._angle)]
        self._heading[ids] = heading[0, self._choice.least_motion(self.arm, ids, np.stack(ways, axis=2))]

    def _chosen(self, ids: Array, at: Array) -> Array:
        del at
        return np.where(self._choice.none_left(ids), _NO_IK, GO_ON)

    def _goal(self, ids: Array, tilt: float) -> Array:
        """(n, 7) with the chosen heading."""
        return self._held.tools(ids, self._heading[ids, None], self._edge[ids][:, None], tilt)[:, 0]

    def _rise(self, ids: Array, at: Array) -> Array:
        return self._held.rise(ids, at, self._goal(ids, -self._carried)[:, 2], self._speed)

    def _carry(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._goal(ids, -self._carried), self._speed)
        return self._held.went(ids, at, 0.015)

    def _tilting(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._goal(ids, self._angle), self._speed / 2)
        return self._held.went(ids, at, 0.015)

    def _drain(self, ids: Array, at: Array) -> Array:
        over = (self._held.loaded(ids, at) == 0) | (self.steps[ids] >= DRAINING)
        return np.where(over, self._held.went(ids, at, 0.03), STAY)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        return np.where(self._held.loaded(env_ids, at) <= self._left, GO_ON, _MISSED)


_NO_IK, _MISSED = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.MISSED_CONTACT)
