"""Turn and TurnTo: push a lever, a valve or a tap round its axis with the closed fingers."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.model.world import JointType
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import FIRST_RUNGS, GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.joints import JointView
from anysim.task.scene import RobotView
from anysim_skills.arm import Arm
from anysim_skills.articulated.part import JointedPart
from anysim_skills.choice import Choice, turns_against
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.recovery.homing import Homing

YAWS = 8
"""Turns of the hand about the axis that are tried; the hand keeps its turn while it goes round."""
STATIONS = 5
"""Points of the arc at which such a turn must be reachable."""
STALLED = 50
"""Control steps in which a part that is pushed does not turn by `PROGRESS` before it counts as jammed."""
PROGRESS = 0.03
"""[rad]"""


class TurnsPart(PhasedSkill):
    """Turns `part` with the closed fingers of `robot`, which push at its frame `<part>.handle`.

    That frame's z is along the axis, away from what the part is mounted on, and its x points away from the axis. The
    fingers go in beside the lever or spoke that ends there, and round with it, however far: the hand does not turn. A
    wheel must leave them room between its hub and its rim.
    """

    first = 1
    first_rungs: ClassVar[Mapping[Outcome, Rung]] = {**FIRST_RUNGS, Outcome.JAMMED: Rung.BACK_OFF}

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        part: JointView,
        tool: str = "tool",
        solver: str = "numba_ik",
        inset: Annotated[
            float, Field(ge=0, description="[m] from the handle towards the axis, where is pushed")
        ] = 0.03,
        beside: Annotated[float, Field(gt=0, description="[m] from the middle of the lever, before and after")] = 0.035,
        clear: Metres = 0.08,
        speed: Speed = 0.3,
        part_speed: Annotated[float, Field(gt=0, description="[m/s] of the fingers on their arc")] = 0.08,
        lead: Annotated[float, Field(gt=0, description="[m] the command is at most this far ahead of the hand")] = 0.04,
        tolerance: Annotated[float, Field(gt=0, description="[rad] that may be missing")] = 0.05,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 200,
    ) -> None:
        if part.found[0].type is not JointType.REVOLUTE:
            raise TaskError(
                f"'{part.name}' does not turn, it is a {part.found[0].type.value} joint; `open` moves a slide"
            )
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self.part, self.joint = JointedPart(env.scene, part), part.found[0]
        self.handle = self.part.handle()
        self._inset, self._beside, self._clear = inset, beside, clear
        self._speed, self._part_speed, self._lead = speed, part_speed, lead
        self._tolerance, self._late = tolerance, steps
        n = env.num_envs
        self._choice, self._turn, self._goal = Choice(n, YAWS), np.zeros((n, 4)), np.zeros(n)
        self._way = np.ones(n)
        """Where the goal is from where the part was: 1 counterclockwise about the axis, -1 clockwise."""
        self._left, self._since = np.zeros(n), np.zeros(n, dtype=np.int64)
        """What was left of the angle at the last progress, and the control steps since then."""
        super().__init__(env, [self.arm])

    @abstractmethod
    def furthest(self) -> float:
        """[rad] that the part has to be turned at most."""

    @abstractmethod
    def aim(self, at: Array) -> Array:
        """(n,) [rad] where the part is to be, in envs in which that is not yet known."""

    def make_phases(self) -> Sequence[Phase]:
        arc = int(self._late + self.furthest() * 100)
        return (
            Phase("rise", self._withdraw, self._withdrawing, self._late),
            Phase("choose", self._choose, self._chosen, 1),
            Phase("approach", None, self._approach, self._late),
            Phase("descend", None, self._descend, self._late),
            Phase("turn", self._touch, self._turning, arc),
            Phase("step back", None, self._step_back, self._late),
            Phase("retreat", self._withdraw, self._withdrawing, self._late),
        )

    def start(self, env_ids: Array) -> None:
        super().start(env_ids)
        self._goal[env_ids] = np.nan

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, opens=False).phases()

    def retry(self, rung: Rung, env: int) -> int | None:
        return self._choice.retry(rung, env)

    # ------------------------------------------------------------------ where the hand is to be

    def _beside_it(self, at: Array, turns: Array, ahead: Array, out: float) -> Array:
        """Tool poses (n, g, 7) at the part, which has turned `ahead` (n, g) [rad], `out` [m] above it along the axis.

        `turns` (n, g, 4) are the hand's; it does not turn with the part.
        """
        handle = self.handle.pose[at]
        push = P.compose(handle, np.broadcast_to(np.array([-self._inset, 0.0, out, 0, 0, 0, 1.0]), handle.shape))
        places = self.part.moved(at, np.repeat(push[:, None], turns.shape[1], axis=1), ahead)[..., :3]
        return np.concatenate([places, turns], axis=-1)

    def _back(self, ids: Array, at: Array) -> Array:
        """(n,) [rad] of the part that are as far as the fingers keep from it."""
        return -self._way[ids] * self._beside / self._radius(at)

    def _radius(self, at: Array) -> Array:
        """(n,) [m] from the axis to where is pushed."""
        handle = self.handle.pose[at]
        inset = np.broadcast_to(np.array([-self._inset, 0.0, 0.0]), (len(at), 3))
        return np.maximum(self.part.reach(handle[:, :3] + P.rotate(handle[:, 3:], inset), at), 1e-3)

    def _one(self, ids: Array, at: Array, ahead: Array, out: float = 0.0) -> Array:
        """Tool poses (n, 7) with the chosen turn of the hand."""
        return self._beside_it(at, self._turn[ids, None], ahead[:, None], out)[:, 0]

    # ------------------------------------------------------------------ phases

    def _withdraw(self, ids: Array, at: Array) -> None:
        self.arm.closed[ids] = True
        away = P.compose(self.arm.tool.pose[at], np.array([[0.0, 0.0, -self._clear, 0.0, 0.0, 0.0, 1.0]]))
        self.arm.go(ids, away, self._speed)

    def _withdrawing(self, ids: Array, at: Array) -> Array:
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1) | (self.steps[ids] >= self._late - 1), GO_ON, STAY)

    def _choose(self, ids: Array, at: Array) -> None:
        self.arm.closed[ids] = True
        new = np.isnan(self._goal[ids])  # a retry goes on to the same goal
        self._goal[ids[new]] = self.aim(at[new])
        to_go = self._goal[ids] - self.part.position(at)
        self._way[ids[new]] = np.where(to_go[new] < 0.0, -1.0, 1.0)
        turns = turns_against(self.handle.quaternion[at], YAWS)
        back = self._back(ids, at)
        stations = [self._beside_it(at, turns, np.repeat(back[:, None], YAWS, axis=1), self._clear)]
        for share in np.linspace(0.0, 1.0, STATIONS):
            stations.append(self._beside_it(at, turns, np.repeat((share * to_go)[:, None], YAWS, axis=1), 0.0))
        chosen = self._choice.least_motion(self.arm, ids, np.stack(stations, axis=2))
        self._turn[ids] = turns[np.arange(len(ids)), chosen]

    def _chosen(self, ids: Array, at: Array) -> Array:
        del at
        return np.where(self._choice.none_left(ids), _NO_IK, GO_ON)

    def _approach(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._one(ids, at, self._back(ids, at), self._clear), self._speed)
        return np.where(self.arm.arrived(ids, at), GO_ON, STAY)

    def _descend(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._one(ids, at, self._back(ids, at)), self._speed / 2)
        there = self.arm.arrived(ids, at, 0.008, 0.06)
        held_up = (self.steps[ids] >= 10) & self.arm.touching(ids, at)
        return np.where(there, GO_ON, np.where(held_up, _COLLISION, STAY))

    def _touch(self, ids: Array, at: Array) -> None:
        del at
        self._left[ids], self._since[ids] = np.inf, 0

    def _turning(self, ids: Array, at: Array) -> Array:
        """Along the arc, ahead of where the part is by as much as the lead allows."""
        to_go = self._way[ids] * (self._goal[ids] - self.part.position(at))
        ahead = self._way[ids] * np.clip(to_go + 0.1, 0.0, self._lead / self._radius(at))
        self.arm.go(ids, self._one(ids, at, ahead), self._part_speed, self._lead)
        on = to_go < self._left[ids] - PROGRESS
        self._left[ids] = np.where(on, to_go, self._left[ids])
        self._since[ids] = np.where(on, 0, self._since[ids] + 1)
        return np.where(to_go <= 0.0, GO_ON, np.where(self._since[ids] > STALLED, _JAMMED, STAY))

    def _step_back(self, ids: Array, at: Array) -> Array:
        """Off the lever, so that it stays where it is when the hand leaves."""
        self.arm.go(ids, self._one(ids, at, self._back(ids, at)), self._speed / 2)
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1) | (self.steps[ids] >= 50), GO_ON, STAY)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        missing = self._way[env_ids] * (self._goal[env_ids] - self.part.position(at))
        return np.where(missing <= self._tolerance, GO_ON, _LOST)


class Turn(TurnsPart):
    """Turn `part` by `angle` with the closed fingers of `robot`, which push at its frame `<part>.handle`."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        angle: Annotated[
            float, Field(description="[rad] from where the part is; negative is clockwise about the axis")
        ],
        **options: object,
    ) -> None:
        self._angle = angle
        super().__init__(env, **options)  # pyright: ignore[reportArgumentType]

    def furthest(self) -> float:
        return abs(self._angle)

    def aim(self, at: Array) -> Array:
        return self.part.position(at) + self._angle


class TurnTo(TurnsPart):
    """Turn `part` to `position` with the closed fingers of `robot`, whichever way that is."""

    def __init__(
        self, env: TaskEnv, *, position: Annotated[float, Field(description="[rad] of the joint")], **options: object
    ) -> None:
        self._position = position
        super().__init__(env, **options)  # pyright: ignore[reportArgumentType]
        low, high = self.joint.lower, self.joint.upper
        if not low <= position <= high:
            raise TaskError(f"'{self.joint.name}' turns from {low:.4g} to {high:.4g} rad, not to {position:.4g}")

    def furthest(self) -> float:
        """Where the joint has no limits, a turn more than to there from zero."""
        ends = np.array([self.joint.lower, self.joint.upper])
        return float(np.where(np.isfinite(ends), abs(ends - self._position), abs(self._position) + 2 * np.pi).max())

    def aim(self, at: Array) -> Array:
        return np.full(len(at), self._position)


_NO_IK, _COLLISION = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.COLLISION)
_JAMMED, _LOST = OUTCOMES.index(Outcome.JAMMED), OUTCOMES.index(Outcome.LOST)
