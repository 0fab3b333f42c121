"""Grasp: close the gripper on an object, and lift it."""

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
from anysim_skills.grasping.bank_files import refuse_counts
from anysim_skills.grasping.banked import BankedGrasps, BankFile, CountsFolder, Pinned, before
from anysim_skills.grasping.candidates import DOWN, TOP_DOWN, across, from_above
from anysim_skills.grasping.hand_room import beyond_tool
from anysim_skills.grasping.in_fingers import InFingers
from anysim_skills.look_ahead import LookAhead, TakesOver
from anysim_skills.object_shapes import ObjectShapes
from anysim_skills.planning import LATENCY, Latency, PlannerName
from anysim_skills.recovery.homing import Homing

ROOM = 0.004
"""[m] the gripper must open wider than the object by this."""
CLOSING_STEPS = 20
SETTLED = 0.02
"""[rad/s, m/s] a gripper whose joints are slower has closed on something, or on nothing."""

CHOOSE, PLAN = 1, 2
"""Phases."""

Offset = Annotated[
    tuple[float, float, float], Field(description="[m] from the object's origin to the grasp, in the object's frame")
]
Force = Annotated[
    float | None, Field(gt=0, description="[N] with which each finger presses; none: all that the gripper has")
]
Metres = Annotated[float, Field(gt=0, description="[m]")]
Speed = Annotated[float, Field(gt=0, description="[m/s] of the tool")]


def closed(ids: Array, steps: Array, *arms: Arm) -> Array:
    """(n,) GO_ON where the fingers of all arms have come to rest, or their control steps (n,) are over; else STAY."""
    settled = (steps >= 5) & (np.max([arm.finger_speed(ids) for arm in arms], axis=0) < SETTLED)
    return np.where(settled | (steps >= CLOSING_STEPS), GO_ON, STAY)


class Grasp(PhasedSkill):
    """Grasp `object` with `robot`, of the candidates the one that needs the least motion; then lift it."""

    first = CHOOSE

    def __init__(
        self,
        env: TaskEnv,
        then: TakesOver | None = None,
        *,
        robot: RobotView,
        object: ObjectView,
        tool: str = "tool",
        solver: str = "numba_ik",
        offset: Offset = (0.0, 0.0, 0.0),
        part_only: Annotated[bool, Field(description="the fingers span what is at `offset` alone")] = False,
        hover: Metres = 0.1,
        lift: Annotated[float, Field(ge=0, description="[m]; 0 leaves that to the next skill")] = 0.1,
        speed: Speed = 0.4,
        descend_speed: Speed = 0.2,
        force: Force = None,
        phase_steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 150,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
        bank: BankFile = None,
        living: CountsFolder = None,
        pinned: Pinned = "",
    ) -> None:
        """`then` is what comes next: a candidate with which that cannot be done is not chosen."""
        self.arm = Arm.of(env, robot, tool=tool, solver=solver, planner=planner, latency=latency)
        self.arm.check_gripper()
        self._press = self.arm.share_of(force)
        self._plans = bool(planner)
        self._object, self._ahead, self._lift = object, LookAhead(self.arm, then), lift
        self._speed, self._descend_speed, self._steps = speed, descend_speed, phase_steps
        self._offset, self._part_only = np.array(offset), part_only
        self._back = np.array([*(-hover * DOWN), 0.0, 0.0, 0.0, 0.0])
        n = env.num_envs
        self.turn = np.zeros((n, 4))
        """(N, 4) the tool's orientation in the chosen grasp."""
        self._hover = hover
        refuse_counts(bank, living, pinned)
        self._bank = None if bank is None else BankedGrasps(env, self.arm, object, bank, living, pinned)
        self._choice = Choice(n, TOP_DOWN if self._bank is None else self._bank.goal_count)
        self._rest = np.zeros(n)
        self._shapes, self._fingers = ObjectShapes(env.scene, object), InFingers(self.arm, object)
        self._tips = beyond_tool(self.arm)
        """[m] from the tool to the finger tips, which stay above what the object lies on."""
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        late = self._steps
        phases = [
            Phase("back off", self._open, self._backing_off, late),
            Phase("choose", self._choose, self._chosen, 1),
            *([self.arm.planned_phase(self._plan)] if self._plans else ()),
            Phase("approach", None, self._approach, late),
            Phase("descend", None, self._descend, late),
            Phase("close", self._close, self._closing, CLOSING_STEPS + 1),
        ]
        if self._lift:
            phases.append(Phase("lift", self._note_height, self._lifting, late))
        return phases

    def foresee(self, following: MovingSkill) -> None:
        self._ahead.foresee(following)

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)
        if self._bank is not None:
            self._bank.start(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, ways=self._ways).phases()

    def anew(self, env_ids: Array) -> None:
        super().anew(env_ids)
        if self._bank is not None:
            self._bank.again(env_ids)

    def retry(self, rung: Rung, env: int) -> int | None:
        """Another plan; the next candidate where one is left; else away from the object, and all of them again."""
        planning = self._plans and self.phase[env] == PLAN
        if rung is Rung.REPLAN and planning:
            return PLAN
        if self._bank is not None and rung in (Rung.CANDIDATE, Rung.RESAMPLE):
            return (CHOOSE if planning else 0) if self._bank.give_up(env) else None
        if rung is Rung.CANDIDATE and self._choice.next(env):
            return CHOOSE if planning else 0
        if rung is Rung.BACK_OFF:
            self._choice.again(env)
            if self._bank is not None:
                self._bank.again(env)
            return 0
        return None

    def about(self, env: int) -> dict[str, object]:
        return super().about(env) if self._bank is None else self._bank.about(env)

    # ------------------------------------------------------------------ phases

    def _open(self, ids: Array, at: Array) -> None:
        self.arm.closed[ids] = False
        self.arm.go(ids, self._before(self.arm.tool.pose[at]), self._speed)

    def _backing_off(self, ids: Array, at: Array) -> Array:
        done = self.arm.arrived(ids, at) | (self.steps[ids] >= self._steps)
        return np.where(done, GO_ON, STAY)

    def _choose(self, ids: Array, at: Array) -> None:
        """Candidates by the least motion to pre-grasp, grasp and whatever comes next."""
        self.arm.closed[ids] = False
        grasps, widths = self._candidates(ids, at)
        targets = np.stack([self._before(grasps), grasps], axis=2)
        n, g = targets.shape[:2]
        effort = self.arm.effort(ids, targets)
        effort[widths > self.arm.aperture - ROOM] = np.inf
        if self._lift:
            raised = grasps + np.array([0.0, 0.0, self._lift, 0.0, 0.0, 0.0, 0.0])
            effort[np.isinf(self.arm.reach(ids, raised, where=np.isfinite(effort))[1])] = np.inf
        effort = self._ahead.effort(ids, at, grasps, effort)
        if self._bank is not None:  # they are in order
            effort = np.where(np.isfinite(effort), np.arange(g), np.inf)
        chosen = self._choice.choose(ids, effort)
        self.turn[ids] = grasps[np.arange(n), chosen, 3:]
        if self._bank is not None:
            self._bank.choose(ids, chosen, ~self._choice.none_left(ids))

    def _ways(self, ids: Array, at: Array) -> Array:
        """(n, g, 2, 7) before each candidate and there."""
        grasps, _ = self._candidates(ids, at)
        return np.stack([self._before(grasps), grasps], axis=2)

    def _candidates(self, ids: Array, at: Array) -> tuple[Array, Array]:
        """Tool poses (n, g, 7), and what the fingers have to span in them (n, g) [m]."""
        thing = self._object.root.pose[at]
        if self._bank is not None:
            return self._bank.goals(ids, thing, self._hover)
        grasps = from_above(thing)
        grasps[..., :3] = self._place(ids, at)[:, None]
        return grasps, across(self._shapes.size_at(ids, self._offset) if self._part_only else self._shapes.size(ids))

    def _before(self, grasps: Array) -> Array:
        """Tool poses (..., 7) from which these are approached."""
        return grasps + self._back if self._bank is None else before(grasps, self._hover)

    def _chosen(self, ids: Array, at: Array) -> Array:
        absent = ~self._object.present[at]
        return np.where(absent, _ABSENT, np.where(self._choice.none_left(ids), _NO_IK, GO_ON))

    def _place(self, ids: Array, at: Array) -> Array:
        """(n, 3) where the object is grasped."""
        thing = self._object.root.pose[at]
        if self._bank is not None:
            return self._bank.position(ids, thing)
        place = thing[:, :3] + P.rotate(thing[:, 3:], np.broadcast_to(self._offset, (len(at), 3)))
        lowest = thing[:, 2] - self._shapes.below(ids, thing) + self._tips
        return np.concatenate([place[:, :2], np.maximum(place[:, 2], lowest)[:, None]], axis=1)

    def _grasp(self, ids: Array, at: Array) -> Array:
        return np.concatenate([self._place(ids, at), self.turn[ids]], axis=1)

    def _plan(self, ids: Array, at: Array) -> None:
        grasp = self._grasp(ids, at)
        self.arm.plan(ids, self._before(grasp)[:, None], then=grasp, touched=self._object)

    def _approach(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._before(self._grasp(ids, at)), self._speed)
        return np.where(self.arm.arrived(ids, at), GO_ON, STAY)

    def _descend(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._grasp(ids, at), self._descend_speed)
        return np.where(self.arm.arrived(ids, at), GO_ON, STAY)

    def _close(self, ids: Array, at: Array) -> None:
        del at
        if self._bank is not None:
            self._bank.closed(ids)
        self.arm.closed[ids], self.arm.press[ids] = True, self._press
        self.arm.go(ids, np.concatenate([self.arm.command[ids, :3], self.turn[ids]], axis=1), self._speed)

    def _closing(self, ids: Array, at: Array) -> Array:
        del at
        steps = self.steps[ids]
        done = steps >= CLOSING_STEPS
        settled = steps >= 5
        if settled.any():
            done[settled] |= self.arm.finger_speed(ids[settled]) < SETTLED
        return self._fingers.judged(ids, done, GO_ON)

    def _note_height(self, ids: Array, at: Array) -> None:
        self._rest[ids] = self._object.root.position[at, 2]
        self.arm.take(ids, at, self._object.root)
        self.arm.go(ids, self.arm.command[ids] + np.array([0, 0, self._lift, 0, 0, 0, 0.0]), self._descend_speed)

    def _lifting(self, ids: Array, at: Array) -> Array:
        held, there = self.arm.holds(ids, at, self._object.root), self.arm.arrived(ids, at)
        return self._fingers.kept(ids, held, np.where(there, GO_ON, STAY))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        if not self._lift:
            return super().succeeded(env_ids, at)
        risen = self._object.root.position[at, 2] - self._rest[env_ids] > 0.5 * self._lift
        return np.where(risen, GO_ON, self._fingers.judged(env_ids, ~risen, _MISSED))


_NO_IK, _ABSENT = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.ADVERSE_STATE)
_UNSTABLE, _MISSED = OUTCOMES.index(Outcome.UNSTABLE_GRASP), OUTCOMES.index(Outcome.MISSED_CONTACT)
