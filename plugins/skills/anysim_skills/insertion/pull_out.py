"""Pull out: draw a held peg out of its hole along the hole's axis, with a wiggle where it sticks."""

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import FIRST_RUNGS, GO_ON, STAY, MovingSkill, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.look_ahead import LookAhead

WIGGLE = np.deg2rad(2.0)
"""[rad] by which a peg that sticks is tilted to and fro."""
WIGGLE_STEPS = 20
"""Control steps of one wiggle."""
STUCK_STEPS = 100
"""Control steps in which a peg that is pulled does not come out by `PROGRESS` before it counts as jammed."""
PROGRESS = 0.002
"""[m]"""

Lead = Annotated[float, Field(gt=0, description="[m] of the command before the hand; it bounds the pull")]


class PullOut(PhasedSkill):
    """Draw the held `object` out of a hole until its frame `tip` is `clear` beyond `mouth`, whose z points out."""

    first_rungs: ClassVar[Mapping[Outcome, Rung]] = {**FIRST_RUNGS, Outcome.JAMMED: Rung.REPLAN}

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        tip: Frame,
        mouth: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        clear: Metres = 0.03,
        speed: Speed = 0.15,
        lead: Lead = 0.03,
        steps: Annotated[int, Field(ge=1, description="control steps that the pull may take")] = 400,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self._object, self._tip, self._mouth = object, tip, mouth
        self._clear, self._speed, self._lead, self._late = clear, speed, lead, steps
        n = env.num_envs
        self._begun, self._out = np.zeros((n, 7)), np.zeros(n)
        """(N, 7) the tool in the mouth's frame when the pull begins; (N,) [m] how far out the tip then was."""
        self._best, self._since = np.zeros(n), np.zeros(n, dtype=np.int64)
        """How far out the tip was at the last progress, and the control steps since then."""
        self._ahead = LookAhead(self.arm)
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("pull", self._take, self._pull, self._late),)

    def retry(self, rung: Rung, env: int) -> int | None:
        """From where it is; what is not held any more has to be grasped again."""
        del env
        return 0 if rung is Rung.REPLAN else None

    def foresee(self, following: MovingSkill) -> None:
        self._ahead.foresee(following)

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        """Tool poses (n, g, c, m, 7) with the object drawn out in grasps (n, g, 7), and on from there."""
        way = np.zeros((len(ids), 3))
        way[:, 2] = np.maximum(self._clear - self.out(at), 0.0)
        poses = grasps[:, :, None].copy()
        poses[..., :3] += P.rotate(self._mouth.quaternion[at], way)[:, None, None]
        return self._ahead.ways(ids, at, grasps, poses)

    def out(self, at: Array) -> Array:
        """(n,) [m] of the tip beyond the mouth along its axis; below zero inside of the hole."""
        return P.rotate_inverse(self._mouth.quaternion[at], self._tip.position[at] - self._mouth.position[at])[:, 2]

    def _take(self, ids: Array, at: Array) -> None:
        self.arm.take(ids, at, self._object.root)
        self._begun[ids] = P.compose(P.inverse(self._mouth.pose[at]), self.arm.tool.pose[at])
        self._out[ids] = self._best[ids] = self.out(at)
        self._since[ids] = 0

    def _pull(self, ids: Array, at: Array) -> Array:
        """Along the axis, as far aside as the hand was when it began; tilted about the mouth's x and y by turns."""
        out = self.out(at)
        on = out > self._best[ids] + PROGRESS
        self._best[ids] = np.where(on, out, self._best[ids])
        self._since[ids] = np.where(on, 0, self._since[ids] + 1)
        target = self._begun[ids]
        target[:, 2] += self._clear + self._lead - self._out[ids]
        target[:, 3:] = P.multiply(self._tilt(ids), target[:, 3:])
        self.arm.go(ids, P.compose(self._mouth.pose[at], target), self._speed, self._lead)
        lost = ~self.arm.holds(ids, at, self._object.root)
        said = np.where(self._since[ids] > STUCK_STEPS, _JAMMED, STAY)
        return np.where(lost, _UNSTABLE, np.where(out >= self._clear, GO_ON, said))

    def _tilt(self, ids: Array) -> Array:
        """(n, 4) none while the peg comes; else to and fro, about one axis and then about the other."""
        since = self._since[ids]
        phase = 2.0 * np.pi * since / WIGGLE_STEPS
        angle = np.where(since >= WIGGLE_STEPS, WIGGLE, 0.0) * np.sin(phase)
        about_y = (since // WIGGLE_STEPS) % 2 == 0
        axis = np.stack([~about_y, about_y, np.zeros(len(ids), dtype=bool)], axis=1).astype(float)
        return P.from_axis_angle(axis, angle)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        held = self.arm.holds(env_ids, at, self._object.root)
        return np.where(held & (self.out(at) >= 0.5 * self._clear), GO_ON, _LOST)


_JAMMED, _LOST = OUTCOMES.index(Outcome.JAMMED), OUTCOMES.index(Outcome.LOST)
_UNSTABLE = OUTCOMES.index(Outcome.UNSTABLE_GRASP)
