"""BiLift: two arms grasp one wide object at its ends, and lift it in step."""

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
from anysim_skills.arm import LEAD, Arm
from anysim_skills.choice import Choice
from anysim_skills.grasping.candidates import DOWN, TOP_DOWN, across, from_above
from anysim_skills.grasping.grasp import CLOSING_STEPS, ROOM, Metres, Speed, closed
from anysim_skills.object_shapes import ObjectShapes
from anysim_skills.planning import LATENCY, Latency, PlannerName
from anysim_skills.recovery.homing import Homing
from anysim_skills.two_hands.arm_pair import ArmPair

BEHIND = 0.03
"""[m] while the command of one arm is further ahead of its tool than this, both wait."""
PAIRS = 2 * TOP_DOWN * TOP_DOWN
"""Which arm takes which end, and how each hand is turned."""
CHOOSE, PLAN = 1, 2
"""Phases."""


class BiLift(PhasedSkill):
    """Lift `object` by `lift` with `robot` and `partner`, each at one of its two ends, `ends` from its origin.

    The two arms may be those of one robot, which have a tool each.

    A candidate is a pair of grasps: who takes which end, and how the hands are turned. What one of the arms does not
    reach is not chosen for either. The object never tilts by more than `tilt`, else it is put down as unstable.

    Attributes:
        closing_steps: control steps that closing may take.
    """

    first = CHOOSE
    closing_steps = CLOSING_STEPS + 1

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        partner: RobotView,
        object: ObjectView,
        ends: Annotated[
            tuple[tuple[float, float, float], tuple[float, float, float]],
            Field(description="[m] the two places to grasp, in the object's frame"),
        ],
        tool: str = "tool",
        partner_tool: Annotated[
            str, Field(description="the tool of the partner; named as the robot's where empty")
        ] = "",
        solver: str = "numba_ik",
        hover: Metres = 0.1,
        lift: Metres = 0.15,
        tilt: Annotated[float, Field(gt=0, description="[rad]")] = 0.2,
        speed: Speed = 0.4,
        lift_speed: Speed = 0.1,
        hold: Annotated[int, Field(ge=1, description="control steps above")] = 10,
        phase_steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 200,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
    ) -> None:
        tools = (robot, tool), (partner, partner_tool or tool)
        self.arms = tuple(Arm.of(env, one, tool=name, solver=solver) for one, name in tools)
        self._together = ArmPair.of(*self.arms, planner=planner, latency=latency) if planner else None
        self._object, self._ends = object, np.array(ends)
        self._shapes = ObjectShapes(env.scene, object)
        self._back = np.array([*(-hover * DOWN), 0.0, 0.0, 0.0, 0.0])
        self._lift, self._tilt, self._hold, self._late = lift, tilt, hold, phase_steps
        self._speed, self._lift_speed = speed, lift_speed
        self._lead = LEAD
        self._dt = env.engine.world.physics.control_dt
        n = env.num_envs
        self._choice = Choice(n, PAIRS)
        self._pair = np.zeros(n, dtype=np.int64)
        self._begun, self._held = np.zeros((n, 2, 7)), np.zeros(n, dtype=np.int64)
        self._rest, self._risen = np.zeros((n, 7)), np.zeros(n)
        super().__init__(env, self.arms)

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("back off", self._open, self._backing_off, self._late),
            Phase("choose", self._choose, self._chosen, 1),
            *([self._together.planned_phase(self._plan)] if self._together else ()),
            Phase("approach", None, self._approach, self._late),
            Phase("descend", None, self._descend, self._late),
            Phase("close", self._close, self._closing, self.closing_steps),
            Phase("lift", self._take, self._lifting, self._late + int(self._lift / (self._lift_speed * self._dt))),
        )

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        """Off the object first, in the direction in which the hands came to it."""
        return (Phase("back off", self._open, self._backing_off, self._late), *Homing(self, *self.arms).phases())

    def retry(self, rung: Rung, env: int) -> int | None:
        """Another plan; the next pair where one is left; else away from the object, and all of them again."""
        planning = self._together is not None and self.phase[env] == PLAN
        if rung is Rung.REPLAN and planning:
            return PLAN
        if rung is Rung.CANDIDATE and self._choice.next(env):
            return CHOOSE if planning else 0
        if rung is Rung.BACK_OFF:
            self._choice.again(env)
            return 0
        return None

    # ------------------------------------------------------------------ to the object

    def _open(self, ids: Array, at: Array) -> None:
        for number, arm in enumerate(self.arms):
            arm.closed[ids] = False
            arm.go(ids, self.before(arm.tool.pose[at], number), self._speed)

    def _backing_off(self, ids: Array, at: Array) -> Array:
        return np.where(self._both(ids, at) | (self.steps[ids] >= self._late), GO_ON, STAY)

    def _both(self, ids: Array, at: Array) -> Array:
        """(n,) bool: both arms have arrived."""
        return self.arms[0].arrived(ids, at) & self.arms[1].arrived(ids, at)

    def before(self, grasps: Array, hand: int) -> Array:
        """Where a hand, 0 or 1, is before and after its grasps (..., 7)."""
        del hand
        return grasps + self._back

    def grasps(self, at: Array, hand: int) -> Array:
        """(n, end, turn, 7) tool poses of a hand, 0 or 1, at the ends: here from above, and the same for both."""
        del hand
        thing = self._object.root.pose[at]
        turns = from_above(thing)
        places = [thing[:, :3] + P.rotate(thing[:, 3:], np.broadcast_to(end, (len(at), 3))) for end in self._ends]
        grasps = np.stack([turns, turns], axis=1)
        grasps[..., :3] = np.stack(places, axis=1)[:, :, None]
        return grasps

    def _choose(self, ids: Array, at: Array) -> None:
        """The pair with the least motion of the arm that has more of it."""
        n, up = len(ids), np.array([0.0, 0.0, self._lift, 0.0, 0.0, 0.0, 0.0])
        widths = across(self._shapes.size(ids))
        efforts: list[Array] = []
        for number, arm in enumerate(self.arms):
            grasps = self.grasps(at, number)
            ways = np.stack([self.before(grasps, number), grasps, grasps + up], axis=3)
            arm.closed[ids] = False
            efforts.append(np.where((widths > arm.aperture - ROOM)[:, None], np.inf, arm.effort(ids, ways)))
        first, second = efforts
        straight = np.maximum(first[:, 0, :, None], second[:, 1, None, :])
        crossed = np.maximum(first[:, 1, :, None], second[:, 0, None, :])
        cost = np.stack([straight, crossed], axis=1).reshape(n, PAIRS)
        self._pair[ids] = self._choice.choose(ids, cost)

    def _chosen(self, ids: Array, at: Array) -> Array:
        none = self._choice.none_left(ids)
        return np.where(~self._object.present[at], _ABSENT, np.where(none, _NO_IK, GO_ON))

    def _targets(self, ids: Array, at: Array) -> tuple[Array, Array]:
        """(n, 7) of each arm: its grasp of the chosen pair."""
        end, turns = np.divmod(self._pair[ids], TOP_DOWN * TOP_DOWN)
        first, second = np.divmod(turns, TOP_DOWN)
        row = np.arange(len(ids))
        return self.grasps(at, 0)[row, end, first], self.grasps(at, 1)[row, 1 - end, second]

    def _plan(self, ids: Array, at: Array) -> None:
        """Both arms before the chosen pair in one plan, from where both go on in a line."""
        assert self._together is not None
        targets = self._targets(ids, at)
        before = np.stack([self.before(target, number) for number, target in enumerate(targets)], axis=1)
        then = np.stack(targets, axis=1)[:, :, None]
        self._together.plan(ids, list(before[:, :, None]), then=then, touched=self._object)

    def _approach(self, ids: Array, at: Array) -> Array:
        for number, target in enumerate(self._targets(ids, at)):
            self.arms[number].go(ids, self.before(target, number), self._speed)
        return np.where(self._both(ids, at), GO_ON, STAY)

    def _descend(self, ids: Array, at: Array) -> Array:
        for arm, target in zip(self.arms, self._targets(ids, at), strict=True):
            arm.go(ids, target, self._speed / 2)
        return np.where(self._both(ids, at), GO_ON, STAY)

    def _close(self, ids: Array, at: Array) -> None:
        del at
        for arm in self.arms:
            arm.stay(ids)
            arm.closed[ids] = True

    def _closing(self, ids: Array, at: Array) -> Array:
        del at
        return closed(ids, self.steps[ids], *self.arms)

    # ------------------------------------------------------------------ up

    def _take(self, ids: Array, at: Array) -> None:
        for number, arm in enumerate(self.arms):
            arm.take(ids, at, self._object.root)
            self._begun[ids, number] = arm.command[ids]
        self._rest[ids] = self._object.root.pose[at]
        self._risen[ids] = self._held[ids] = 0

    def _lifting(self, ids: Array, at: Array) -> Array:
        """Both commands rise by the same height, and only while both tools follow."""
        with_it = self.behind(ids, at) < BEHIND
        self._risen[ids] = np.minimum(self._lift, self._risen[ids] + with_it * self._lift_speed * self._dt)
        for number, arm in enumerate(self.arms):
            target = self._begun[ids, number]
            target[:, 2] += self._risen[ids]
            arm.go(ids, target, 1.5 * self._lift_speed, self._lead)
        up = (self._risen[ids] >= self._lift) & self.up(ids, at)
        self._held[ids] = (self._held[ids] + 1) * up
        held = self.arms[0].holds(ids, at, self._object.root) & self.arms[1].holds(ids, at, self._object.root)
        lost = ~held | (self.tilted(ids, at) > self._tilt)
        return np.where(lost, _UNSTABLE, np.where(self._held[ids] >= self._hold, GO_ON, STAY))

    def behind(self, ids: Array, at: Array) -> Array:
        """(n,) [m] how far the hand that is further behind its command has to come up."""
        return np.maximum(*(arm.ahead(ids, at) for arm in self.arms))

    def up(self, ids: Array, at: Array) -> Array:
        """(n,) bool: both hands are where they are to be above."""
        return self._both(ids, at)

    def tilted(self, ids: Array, at: Array) -> Array:
        """(n,) [rad] how far the object leans from how it lay, whatever its heading."""
        turn = P.multiply(self._object.root.quaternion[at], P.conjugate(self._rest[ids, 3:]))
        up = P.rotate(turn, np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(ids), 3)))
        return np.arctan2(np.hypot(up[:, 0], up[:, 1]), up[:, 2])

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        risen = self._object.root.position[at, 2] - self._rest[env_ids, 2]
        return np.where(risen > 0.8 * self._lift, GO_ON, _MISSED)


_NO_IK, _ABSENT = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.ADVERSE_STATE)
_UNSTABLE, _MISSED = OUTCOMES.index(Outcome.UNSTABLE_GRASP), OUTCOMES.index(Outcome.MISSED_CONTACT)
