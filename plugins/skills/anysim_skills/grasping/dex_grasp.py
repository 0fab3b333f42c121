"""DexGrasp: close a hand with several fingers around a bar or a bottle, and lift it."""

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
from anysim_skills.grasping.banked import BankedGrasps, BankFile, CountsFolder, Pinned
from anysim_skills.grasping.banked_hand import OfHand, synergies
from anysim_skills.grasping.grasp import Metres, Offset, Speed
from anysim_skills.grasping.hand import Hand
from anysim_skills.grasping.in_fingers import InFingers
from anysim_skills.look_ahead import LookAhead
from anysim_skills.object_shapes import ObjectShapes
from anysim_skills.recovery.homing import Homing

ANGLES = 16
"""Directions of approach about the object's long axis; in each the hand may point either way."""
STEEPEST = 0.3
"""Sine of the elevation from which on a hand that comes from below, or whose fingers point up, is no candidate."""
OVER = 0.15
"""[m] that the hand is higher on its way to where it approaches from."""
BALL = 0.01
"""Of its size, by which a ball is not as long in all directions."""
GOALS = 64
"""So many candidates of a bank are a goal set."""


class DexGrasp(PhasedSkill):
    """Close the hand of `robot` around `object` by a synergy, each finger until it touches, then lift.

    The tool's z is out of the palm and its y along the fingers. Candidates lay its x along the object's long axis, the
    vertical for a ball, and come from all sides across it; `place` is where that axis then is in the tool's frame.
    Those of a bank say where the hand is and by which synergy it closes.
    """

    first = 1

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        synergy: str = "power",
        tool: str = "tool",
        hand: Annotated[str, Field(description="the channel of the fingers")] = "eef",
        solver: str = "numba_ik",
        place: Annotated[tuple[float, float, float], Field(description="[m] in the tool's frame")] = (0.0, 0.0, 0.0),
        offset: Offset = (0.0, 0.0, 0.0),
        tilt: Annotated[
            float, Field(ge=0, description="[rad] by which the palm looks down from across the axis")
        ] = 0.0,
        least: Annotated[float, Field(gt=0, description="[m] that the tool is above the object's lowest point")] = 0.05,
        hover: Metres = 0.12,
        lift: Metres = 0.1,
        links: Annotated[int, Field(ge=1, description="of fingers that touch what is held")] = 3,
        speed: Speed = 0.3,
        phase_steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 250,
        bank: BankFile = None,
        living: CountsFolder = None,
        pinned: Pinned = "",
    ) -> None:
        self.arm = Arm.of(env, robot, gripper=hand, tool=tool, solver=solver)
        self.hand = Hand.of(env, robot, channel=hand)
        self._object = object
        self._synergy = np.full(env.num_envs, self.hand.named(synergy))
        self._place, self._offset = np.array(place), np.array(offset)
        self._tilt, self._least = tilt, least
        self._hover, self._lift, self._links = hover, lift, links
        self._speed, self._late = speed, phase_steps
        self._shapes, self._fingers = ObjectShapes(env.scene, object), InFingers(self.arm, object)
        n = env.num_envs
        refuse_counts(bank, living, pinned)
        self._bank: BankedGrasps | None = None
        if bank is not None:
            fit = OfHand(env.engine.index.robot(robot.name).model, self.hand)
            self._bank = BankedGrasps(env, self.arm, object, bank, living, pinned, fit=fit, goals=GOALS)
            self._synergies = synergies(self.hand, self._bank.banks.kind, self._bank.banks.score.shape[1])
        self._choice = Choice(n, 2 * ANGLES if self._bank is None else self._bank.goal_count)
        self._goal, self._rest = np.zeros((n, 7)), np.zeros(n)
        self._ahead = LookAhead(self.arm)
        super().__init__(env, [self.arm, self.hand])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("back off", self._open, self._backing_off, self._late),
            Phase("choose", self._choose, self._chosen, 1),
            Phase("over", None, self._over, 100),
            Phase("pre", None, self._pre, self._late),
            Phase("approach", None, self._approach, self._late),
            Phase("close", self._close, self._closing, 120),
            Phase("lift", self._take, self._lifting, self._late),
            Phase("hold", None, self._holding, 30),
        )

    def foresee(self, following: MovingSkill) -> None:
        self._ahead.foresee(following)

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)
        if self._bank is not None:
            self._bank.start(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, hand=self.hand).phases()

    def anew(self, env_ids: Array) -> None:
        super().anew(env_ids)
        if self._bank is not None:
            self._bank.again(env_ids)

    def retry(self, rung: Rung, env: int) -> int | None:
        """The next candidate where one is left; else away from the object, and all of them again."""
        if self._bank is not None and rung in (Rung.CANDIDATE, Rung.RESAMPLE):
            return 0 if self._bank.give_up(env) else None
        if rung is Rung.CANDIDATE and self._choice.next(env):
            return 0
        if rung is Rung.BACK_OFF:
            self._choice.again(env)
            if self._bank is not None:
                self._bank.again(env)
            return 0
        return None

    def about(self, env: int) -> dict[str, object]:
        return super().about(env) if self._bank is None else self._bank.about(env)

    # ------------------------------------------------------------------ to the object

    def _open(self, ids: Array, at: Array) -> None:
        self.hand.open(ids)
        self.arm.go(ids, _along(self.arm.tool.pose[at], -self._hover), self._speed)

    def _backing_off(self, ids: Array, at: Array) -> Array:
        return np.where((self.arm.arrived(ids, at) & (self.steps[ids] > 30)) | (self.steps[ids] >= 100), GO_ON, STAY)

    def _candidates(self, ids: Array, at: Array) -> Array:
        """(n, g, 7) tool poses."""
        thing, size = self._object.root.pose[at], self._shapes.size(ids)
        long = P.rotate(thing[:, 3:], np.eye(3)[np.argmax(size, axis=1)])
        ball = np.ptp(size, axis=1) < BALL * size.max(axis=1)
        long = np.where(ball[:, None], np.array([0.0, 0.0, 1.0]), long)
        middle = thing[:, :3] + P.rotate(thing[:, 3:], np.broadcast_to(self._offset, (len(at), 3)))
        grasps = around(middle, long, self._place)
        return tilted(grasps, middle, self._place, self._tilt) if self._tilt else grasps

    def _choose(self, ids: Array, at: Array) -> None:
        self.hand.open(ids)
        if self._bank is not None:
            self._choose_of_bank(self._bank, ids, at)
            return
        grasps = self._candidates(ids, at)
        up = np.array([0.0, 0.0, self._lift, 0.0, 0.0, 0.0, 0.0])
        ways = np.stack([_along(grasps, -self._hover), grasps, grasps + up], axis=2)
        n, g = ways.shape[:2]
        effort = self.arm.effort(ids, ways)
        lowest = self._object.root.position[at, 2] - self._shapes.below(ids, self._object.root.pose[at])
        turn = grasps[..., 3:]
        out, fingers = (P.rotate(turn, np.broadcast_to(np.eye(3)[k], (n, g, 3)))[..., 2] for k in (2, 1))
        bad = (out > STEEPEST) | (fingers > STEEPEST) | (grasps[..., 2] < lowest[:, None] + self._least)
        effort = self._ahead.passed(ids, at, grasps, np.where(bad, np.inf, effort))
        self._goal[ids] = grasps[np.arange(n), self._choice.choose(ids, effort)]

    def _choose_of_bank(self, bank: BankedGrasps, ids: Array, at: Array) -> None:
        """Of those as good as the best that the arm reaches, before, at and after it, the one of the least motion.

        A hand does not come from below. One from behind the object would push it over on its way there.
        """
        grasps, widths = bank.goals(ids, self._object.root.pose[at], self._hover)
        up = np.array([0.0, 0.0, self._lift, 0.0, 0.0, 0.0, 0.0])
        ways = np.stack([_along(grasps, -self._hover), grasps, grasps + up], axis=2)
        effort = self.arm.effort(ids, ways)
        bad = (P.rotate(grasps[..., 3:], np.broadcast_to(np.eye(3)[2], (*grasps.shape[:2], 3)))[..., 2]) > STEEPEST
        fit = np.isfinite(effort) & np.isfinite(widths) & ~bad
        effort = self._ahead.passed(ids, at, grasps, np.where(fit, effort, np.inf))
        fit = np.isfinite(effort)
        chosen = self._choice.choose(ids, np.where(bank.alike(ids, fit), effort, np.inf))
        bank.choose(ids, chosen, ~self._choice.none_left(ids))
        self._goal[ids] = grasps[np.arange(len(ids)), chosen]
        self._synergy[ids] = self._synergies[bank.which(ids), bank.number[ids]]

    def _chosen(self, ids: Array, at: Array) -> Array:
        none = self._choice.none_left(ids)
        return np.where(~self._object.present[at], _ABSENT, np.where(none, _NO_IK, GO_ON))

    def _over(self, ids: Array, at: Array) -> Array:
        """Above where the approach begins, so that fingers that point down pass over what stands there."""
        target = _along(self._goal[ids], -self._hover)
        target[:, 2] += OVER
        self.arm.go(ids, target, self._speed)
        near = P.norm(target[:, :2] - self.arm.tool.position[at, :2]) < 0.03
        return np.where(near | (self.steps[ids] >= 80), GO_ON, STAY)

    def _pre(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, _along(self._goal[ids], -self._hover), self._speed)
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY)

    def _approach(self, ids: Array, at: Array) -> Array:
        """Until the tool is there, or the palm holds it up."""
        self.arm.go(ids, self._goal[ids], self._speed / 3, 0.03)
        there = self.arm.arrived(ids, at) | self.arm.touching(ids, at)
        return np.where(there, GO_ON, STAY)

    def _close(self, ids: Array, at: Array) -> None:
        del at
        self.arm.stay(ids)
        if self._bank is not None:
            self._bank.closed(ids)
        self.hand.close(ids, self._synergy[ids])

    def _closing(self, ids: Array, at: Array) -> Array:
        del at
        still = self.hand.closed(ids) & (self.arm.finger_speed(ids) < 0.3)
        done = still | (self.steps[ids] >= 100)
        if not done.any():
            return np.full(len(ids), STAY)
        around = self.hand.touches(ids)[1] >= self._links
        return np.where(done & ~around, _MISSED, self._fingers.judged(ids, done & around, GO_ON))

    # ------------------------------------------------------------------ up

    def _take(self, ids: Array, at: Array) -> None:
        self._rest[ids] = self._object.root.position[at, 2]
        self.arm.take(ids, at, self._object.root)
        up = np.array([0.0, 0.0, self._lift, 0.0, 0.0, 0.0, 0.0])
        self.arm.go(ids, self.arm.command[ids] + up, self._speed / 3)

    def _held(self, ids: Array, at: Array, said: Array) -> Array:
        return self._fingers.kept(ids, self.arm.holds(ids, at, self._object.root), said)

    def _lifting(self, ids: Array, at: Array) -> Array:
        return self._held(ids, at, np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY))

    def _holding(self, ids: Array, at: Array) -> Array:
        return self._held(ids, at, np.where(self.steps[ids] >= 10, GO_ON, STAY))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        risen = self._object.root.position[at, 2] - self._rest[env_ids] > 0.5 * self._lift
        return np.where(risen & (self.hand.touches(env_ids)[1] >= self._links), GO_ON, _MISSED)


def around(middle: Array, long: Array, place: Array) -> Array:
    """Tool poses (n, 2 * ANGLES, 7) across axes `long` (n, 3) through points (n, 3), which are at `place` (3,) in them.

    The first half has the tool's x along the axis, the second against it.
    """
    seed = np.eye(3)[np.argmin(np.abs(long), axis=1)]
    first = P.cross(long, seed)
    first = first / P.norm(first)[:, None]
    second = P.cross(long, first)
    angle = 2 * np.pi / ANGLES * np.arange(ANGLES)
    out = np.cos(angle)[:, None] * first[:, None] + np.sin(angle)[:, None] * second[:, None]
    x = np.concatenate([np.broadcast_to(long[:, None], out.shape), np.broadcast_to(-long[:, None], out.shape)], axis=1)
    z = np.concatenate([out, out], axis=1)
    columns = np.stack([x, P.cross(z, x), z], axis=-1)
    turn = np.array([P.from_matrix(m) for m in columns.reshape(-1, 3, 3)]).reshape(*x.shape[:2], 4)
    return np.concatenate([middle[:, None] - P.rotate(turn, np.broadcast_to(place, x.shape)), turn], axis=-1)


def tilted(grasps: Array, middle: Array, place: Array, angle: float) -> Array:
    """Tool poses (n, g, 7) that have points (n, 3) at `place`, turned about those so that the palms look down more."""
    down = np.array([0.0, 0.0, -1.0])
    out = P.rotate(grasps[..., 3:], np.broadcast_to([0.0, 0.0, 1.0], (*grasps.shape[:2], 3)))
    axis = P.cross(out, np.broadcast_to(down, out.shape))
    level = P.norm(axis)
    axis = axis / np.maximum(level, 1e-6)[..., None]
    turn = P.multiply(P.from_axis_angle(axis, angle * (level > 1e-6)), grasps[..., 3:])  # not where it looks down or up
    return np.concatenate([middle[:, None] - P.rotate(turn, np.broadcast_to(place, out.shape)), turn], axis=-1)


def _along(poses: Array, distance: float) -> Array:
    """The poses (..., 7) moved along their own z [m]."""
    way = np.broadcast_to(np.array([0.0, 0.0, distance]), (*poses.shape[:-1], 3))
    return np.concatenate([poses[..., :3] + P.rotate(poses[..., 3:], way), poses[..., 3:]], axis=-1)


_NO_IK, _ABSENT = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.ADVERSE_STATE)
_UNSTABLE, _MISSED = OUTCOMES.index(Outcome.UNSTABLE_GRASP), OUTCOMES.index(Outcome.MISSED_CONTACT)
