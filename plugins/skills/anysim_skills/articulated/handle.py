"""A hand at a handle: what opening and closing have in common."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import FIRST_RUNGS, GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.joints import RangedJointView
from anysim.task.scene import RobotView
from anysim_skills.arm import Arm
from anysim_skills.articulated.bar_grasps import TURNS, bar_grasps
from anysim_skills.articulated.part import Part
from anysim_skills.choice import Choice, motion_along
from anysim_skills.grasping.bank_files import refuse_counts
from anysim_skills.grasping.banked import BankedGrasps
from anysim_skills.grasping.grasp import CLOSING_STEPS, ROOM, Speed, closed
from anysim_skills.grasping.hand_room import has_room
from anysim_skills.grasping.in_fingers import InFingers
from anysim_skills.planning import LATENCY, Latency, PlannerName
from anysim_skills.recovery.homing import Homing

STATIONS = 5
"""Points of the part's way at which a grasp must be reachable."""
CLEAR = 0.1
"""[m] the hand is before the handle when it comes, and after it has gone."""

SHORT = 0.006
"""[m] a hand that comes as near to where it is to be is there."""
AWAY = 0.06
"""[m] that a grasp of a bank is to let the hand go back, once the part is where it is to be."""

STALLED = 50
"""Control steps in which a part that is moved does not get on by `PROGRESS` before it counts as jammed."""
PROGRESS = 0.005
"""Of the joint's range."""

Share = Annotated[float, Field(ge=0, le=1, description="of the joint's range; 0 is closed")]


class AtHandle(PhasedSkill):
    """A skill that moves a part by its handle, whose frame is `<part>.handle`.

    Of ten grasps of the bar the one is chosen that reaches the way to the handle and the whole way of the part with the
    least motion; of those of a bank the best that reaches them.
    """

    first = 1
    first_rungs: ClassVar[Mapping[Outcome, Rung]] = {**FIRST_RUNGS, Outcome.JAMMED: Rung.BACK_OFF}
    share: float
    """Where the part is to go."""
    turns: ClassVar[Array] = TURNS
    """(G, 4) orientations of the tool in the handle's frame."""
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """[m] the bar's middle in the tool's frame."""
    onto: ClassVar[tuple[float, float, float]] = (0.0, 0.0, 1.0)
    """The direction in the tool's frame in which the hand comes to the bar."""
    force: float | None = None
    """[N] with which each finger presses; None: all that the gripper has."""
    closing_steps: ClassVar[int] = CLOSING_STEPS
    """Control steps after which fingers count as closed."""

    def __init__(
        self,
        env: TaskEnv,
        bank: Path | None = None,
        living: Path | None = None,
        pinned: str = "",
        *,
        robot: RobotView,
        part: RangedJointView,
        tool: str = "tool",
        solver: str = "numba_ik",
        speed: Speed = 0.3,
        part_speed: Annotated[float, Field(gt=0, description="[m/s] of the handle")] = 0.1,
        lead: Annotated[float, Field(gt=0, description="[m] the command is at most this far ahead of the hand")] = 0.05,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 200,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
    ) -> None:
        """`bank`, `living` and `pinned` are of skills that close on the handle."""
        self.arm = Arm.of(env, robot, tool=tool, solver=solver, planner=planner, latency=latency)
        self._press = self.arm.share_of(self.force)
        self._plans = bool(planner)
        self.part = Part(env.scene, part)
        self.held = self.held_part()
        self.handle = self.held.handle()
        self.fingers = InFingers(self.arm, self.part.owner)
        self.speed, self.part_speed, self.lead, self.late = speed, part_speed, lead, steps
        refuse_counts(bank, living, pinned)
        self._bank: BankedGrasps | None = None
        if bank is not None:
            self._bank = BankedGrasps(env, self.arm, self.part.owner, bank, living, pinned, self.held.body)
        n = env.num_envs
        self._choice = Choice(n, len(self.turns) if self._bank is None else self._bank.goal_count)
        self._turn = np.zeros((n, 4))
        """The chosen orientation in the handle's frame, where it is of no bank."""
        self._local = np.zeros((n, 7))
        """The chosen tool pose in the held part's frame, where it is of a bank."""
        self._grip = np.zeros((n, 7))
        """The tool in the frame of what is moved when that begins to move."""
        self._left, self._since = np.zeros(n), np.zeros(n, dtype=np.int64)
        """What was left of the way at the last progress, and the control steps since then."""
        super().__init__(env, [self.arm])

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)
        if self._bank is not None:
            self._bank.start(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, onto=self.onto, ways=self._all_ways).phases()

    def anew(self, env_ids: Array) -> None:
        super().anew(env_ids)
        if self._bank is not None:
            self._bank.again(env_ids)

    def retry(self, rung: Rung, env: int) -> int | None:
        phase = self._choice.retry(rung, env) if self._bank is None else self._next_of_bank(self._bank, rung, env)
        return 1 if phase == 0 and self.phases[self.phase[env]] == "plan" else phase  # it is away from the part already

    def _next_of_bank(self, bank: BankedGrasps, rung: Rung, env: int) -> int | None:
        """The next candidate where one is left; away from the part also all of them again."""
        if rung not in (Rung.CANDIDATE, Rung.RESAMPLE, Rung.BACK_OFF):
            return None
        left = bank.give_up(env)
        if rung is Rung.BACK_OFF and not left:
            bank.again(env)
        return 0 if left or rung is Rung.BACK_OFF else None

    def about(self, env: int) -> dict[str, object]:
        return super().about(env) if self._bank is None else self._bank.about(env)

    def approach_phases(self) -> list[Phase]:
        """Away from the part, choose, before the handle, to the handle."""
        return [
            Phase("back off", self.leave_handle, self.leaving, self.late),
            Phase("choose", self._choose, self._chosen, 1),
            *([self.arm.planned_phase(self._plan)] if self._plans else ()),
            Phase("approach", None, self.approach, self.late),
            Phase("reach in", None, self._reach_in, self.late),
        ]

    def depth(self, ids: Array) -> Array:
        """(n,) [m] how far beyond the handle's middle the tool goes."""
        return np.zeros(len(ids))

    def held_part(self) -> Part:
        """What is taken hold of by its handle: the part itself, or what is on it."""
        return self.part

    @cached_property
    def _cramped(self) -> Array:
        """(G,) bool: something is in the way of the open hand, further than it may stop short."""
        frame = self.env.engine.index.frame(self.handle.name)
        grasps = bar_grasps(np.array([[*frame.position, *frame.quaternion]]), self.turns)[0]
        return ~has_room(self.arm, self.part.owner.entities[0], frame.body, grasps, SHORT)

    def excluded(self, grasps: Array) -> Array | None:
        """(n, G) bool of tool poses (n, G, 7): those that are not to be chosen.

        Those which the open hand is kept from by what is around the handle, as long as there are others.
        """
        return None if self._cramped.all() else np.broadcast_to(self._cramped, grasps.shape[:2])

    def to_go(self, at: Array) -> Array:
        """(n,) [m, rad] that the part is to be moved."""
        return self.part.closed + self.share * self.part.span - self.part.position(at)

    # ------------------------------------------------------------------ to the handle and away from it

    def leave_handle(self, ids: Array, at: Array) -> None:
        """Begin to let go of it, and to go back."""
        self.arm.closed[ids] = False
        away = P.compose(self.arm.tool.pose[at], np.array([[*(-CLEAR * np.array(self.onto)), 0.0, 0.0, 0.0, 1.0]]))
        self.arm.command[ids] = self.arm.tool.pose[at]
        self.arm.go(ids, away, self.speed)

    def leaving(self, ids: Array, at: Array) -> Array:
        """Until the hand is clear, or as far as it gets."""
        waiting = self.steps[ids] < 10  # the fingers open first
        self.arm.speed[ids] = np.where(waiting, 0.0, self.speed)
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1) | (self.steps[ids] >= self.late - 1), GO_ON, STAY)

    def _choose(self, ids: Array, at: Array) -> None:
        if self._bank is not None:
            self._choose_of_bank(self._bank, ids, at)
            return
        grasps = self._of_bar(ids, at)
        ways = self._ways(at, grasps)
        self._turn[ids] = self.turns[self._choice.least_motion(self.arm, ids, ways, self.excluded(grasps))]

    def _of_bar(self, ids: Array, at: Array) -> Array:
        """(n, G, 7) tool poses at the bar."""
        handle = self.handle.pose[at]
        grasps = bar_grasps(handle, self.turns)
        grasps[..., :3] += (self.depth(ids)[:, None] * _into(handle))[:, None] - in_world(grasps, self.place)
        return grasps

    def _all_ways(self, ids: Array, at: Array) -> Array:
        """(n, g, S + 1, 7) with all candidates."""
        if self._bank is None:
            return self._ways(at, self._of_bar(ids, at))
        goals, _ = self._bank.goals(ids, self.part.pose(at), CLEAR, self.part.owner.root.pose[at])
        return self._ways(at, np.concatenate(self._bank.both_ways(ids, goals)[0], axis=1))

    def _choose_of_bank(self, bank: BankedGrasps, ids: Array, at: Array) -> None:
        """The best candidate, either way round, with which the arm goes the whole way in one posture, and off the part.

        Then those with which it does not get off, those with which it changes its posture under way, and last those at
        which the hand touches more than the handle.
        """
        part, rows = self.held.pose(at), np.arange(len(ids))
        goals, widths = bank.goals(ids, part, CLEAR, self.part.owner.root.pose[at])
        grasps, room = bank.both_ways(ids, goals)
        rank, effort = np.zeros(room.shape), np.zeros(room.shape)
        for number, way in enumerate(grasps):
            motion = motion_along(self.arm, ids, at, self._there_and_away(at, way))
            rank[number] = 1.0 * np.isinf(motion[..., -2]) + np.isinf(motion[..., -1]) + 3.0 * ~room[number]
            effort[number] = self.arm.effort(ids, self._ways(at, way))
        rank[np.isinf(effort) | (widths > self.arm.aperture - ROOM)] = np.inf
        count = bank.goal_count
        chosen = self._choice.choose(ids, np.arange(count) + count * rank.min(axis=0))
        bank.choose(ids, chosen, ~self._choice.none_left(ids))
        turn = np.lexsort((effort[:, rows, chosen], rank[:, rows, chosen]), axis=0)[0]
        self._local[ids] = P.compose(P.inverse(part), grasps[turn, rows, chosen])

    def _ways(self, at: Array, grasps: Array) -> Array:
        """(n, G, S + 1, 7) tools at (n, G, 7) from where they come on, to where the part is to go."""
        return np.concatenate([self._short_of(grasps, CLEAR)[:, :, None], self.stations(at, grasps)], axis=2)

    def _there_and_away(self, at: Array, grasps: Array) -> Array:
        """(n, G, S + 2, 7) the same, and off the part in the end."""
        ways = self._ways(at, grasps)
        return np.concatenate([ways, self._short_of(ways[:, :, -1], AWAY)[:, :, None]], axis=2)

    def _short_of(self, grasps: Array, distance: float) -> Array:
        back = np.concatenate([in_world(grasps, self.onto), np.zeros((*grasps.shape[:2], 4))], axis=-1)
        return grasps - distance * back

    def stations(self, at: Array, grasps: Array) -> Array:
        """(n, G, S, 7) where tools at (n, G, 7) are on the way of the part."""
        return along(self.part, at, grasps, self.to_go(at))

    def _chosen(self, ids: Array, at: Array) -> Array:
        del at
        return np.where(self._choice.none_left(ids), _NO_IK, GO_ON)

    def at_handle(self, ids: Array, at: Array, short_of: float) -> Array:
        """Tool poses (n, 7) at the handle, or short of it on the hand's way [m]."""
        if self._bank is not None:
            grasp = P.compose(self.held.pose(at), self._local[ids])
            grasp[:, :3] -= short_of * in_world(grasp, self.onto)
            return grasp
        handle = self.handle.pose[at]
        grasp = np.concatenate([handle[:, :3], P.multiply(handle[:, 3:], self._turn[ids])], axis=1)
        grasp[:, :3] += self.depth(ids)[:, None] * _into(handle) - short_of * in_world(grasp, self.onto)
        grasp[:, :3] -= in_world(grasp, self.place)
        return grasp

    def _plan(self, ids: Array, at: Array) -> None:
        """To before the handle, in a posture from which the arm can go the whole way of the part."""
        way = self.stations(at, self.at_handle(ids, at, 0.0)[:, None])[:, 0]
        self.arm.plan(ids, self.at_handle(ids, at, CLEAR)[:, None], then=way, touched=self.part.owner)

    def approach(self, ids: Array, at: Array) -> Array:
        """To where the hand comes to the bar from."""
        self.arm.go(ids, self.at_handle(ids, at, CLEAR), self.speed)
        return np.where(self.arm.arrived(ids, at), GO_ON, STAY)

    def _reach_in(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self.at_handle(ids, at, 0.0), self.speed / 2, 0.02)
        there = self.arm.arrived(ids, at, SHORT, 0.06)
        return np.where(there | ((self.steps[ids] >= 10) & self.arm.touching(ids, at)), GO_ON, STAY)

    def closing_phase(self) -> Phase:
        """Close the fingers on the handle."""
        return Phase("close", self.close, self.closing, self.closing_steps + 1)

    def close(self, ids: Array, at: Array) -> None:
        """Begin to close the fingers."""
        del at
        if self._bank is not None:
            self._bank.closed(ids)
        self.arm.closed[ids], self.arm.press[ids] = True, self._press
        self.arm.stay(ids)

    def closing(self, ids: Array, at: Array) -> Array:
        """Until they are."""
        del at
        return self.fingers.judged(ids, closed(ids, self.steps[ids], self.arm) == GO_ON, GO_ON)

    # ------------------------------------------------------------------ with the part

    def take(self, ids: Array, at: Array) -> None:
        """From here on the hand goes where the part takes it."""
        self.go_with(self.part, ids, at)

    def go_with(self, part: Part, ids: Array, at: Array) -> None:
        """The same of another one that is in the hand."""
        self._grip[ids] = P.compose(P.inverse(part.pose(at)), self.arm.tool.pose[at])
        self._left[ids], self._since[ids] = np.inf, 0

    def follow(self, ids: Array, at: Array, part: Part | None = None, share: float | None = None) -> Array:
        """Move the part on by its handle, or another one to a share; (n,) [m] how far the hand has slipped from it."""
        part, share = part or self.part, self.share if share is None else share
        here = part.position(at)
        goal = part.closed + share * part.span
        tool = P.compose(part.pose(at), self._grip[ids])
        reach = np.maximum(part.reach(tool[:, :3], at), 1e-3)
        ahead = np.clip(goal - here, -self.lead / reach, self.lead / reach)
        target = part.moved(at, tool[:, None], ahead[:, None])[:, 0]
        self.arm.go(ids, target, self.part_speed, self.lead)
        return P.norm(self.arm.tool.position[at] - tool[:, :3])

    def jammed(self, ids: Array, at: Array, part: Part | None = None, share: float | None = None) -> Array:
        """(n,) bool: the part has not got on for a while, or another one on its way to a share."""
        left = np.abs((part or self.part).joint.opening[at] - (self.share if share is None else share))
        on = left < self._left[ids] - PROGRESS
        self._left[ids] = np.where(on, left, self._left[ids])
        self._since[ids] = np.where(on, 0, self._since[ids] + 1)
        return self._since[ids] > STALLED

    def phases_away(self) -> Sequence[Phase]:
        """Let go, and away from the part."""
        return (Phase("retreat", self.leave_handle, self.leaving, self.late),)


def _into(handle: Array) -> Array:
    """(n, 3) from handles (n, 7) into their fronts."""
    return P.rotate(handle[:, 3:], np.broadcast_to(np.array([-1.0, 0.0, 0.0]), (len(handle), 3)))


def along(part: Part, at: Array, grasps: Array, to_go: Array) -> Array:
    """(n, G, S, 7) where tools at (n, G, 7) are while a part goes so far (n,) [m, rad]."""
    by = np.repeat((np.linspace(0.0, 1.0, STATIONS) * to_go[:, None])[:, None], grasps.shape[1], axis=1)
    return np.stack([part.moved(at, grasps, by[..., s]) for s in range(STATIONS)], axis=2)


def in_world(tools: Array, vector: Sequence[float]) -> Array:
    """(..., 3) a vector in the frame of tool poses (..., 7), in the world's axes."""
    return P.rotate(tools[..., 3:], np.broadcast_to(np.array(vector), (*tools.shape[:-1], 3)))


_NO_IK = OUTCOMES.index(Outcome.NO_IK)
