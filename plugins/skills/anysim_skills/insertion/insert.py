"""Insert: put a held peg into a hole, with a spiral search where it does not find it, and let go of it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.choice import Choice
from anysim_skills.grasping.bank_files import KEYS, refuse_counts
from anysim_skills.grasping.banked import CountsFolder, Pinned
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.grasping.held import RESTING, Moves, PutsDown
from anysim_skills.insertion.banked_insertions import BankedInsertions

GENTLE = 0.012
"""[m] lead of the command while the peg is lowered: it bounds the force."""
ALIGNING_STEPS = 75
SEARCHING_STEPS = 300
FOUND = 0.004
"""[m] a tip that is this much lower than where it first touched has found the hole."""
UPRIGHT = 0.999
"""The height of a mouth's axis from which on what is put into it rises straight up."""
TURNED = 1e-6
"""Of the vector part of a quaternion: a tip's axes that are turned further are not those of the object."""
TURN = 0.35
"""[rad] of the spiral in a control step."""
InsertionsFile = Annotated[
    Path | None, Field(description="a bank of insertions, or a folder of banks; none: turns by `symmetry`")
]


class Insert(PutsDown):
    """Put the held `object` into a hole: its frame `tip` goes through `mouth` to `hole`, whose z point out of it.

    The z axis of `tip` points back along the object.
    """

    def __init__(
        self,
        env: TaskEnv,
        keys: tuple[str, str] = KEYS,
        *,
        robot: RobotView,
        object: ObjectView,
        tip: Frame,
        hole: Frame,
        mouth: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        symmetry: Annotated[int, Field(ge=1, description="turns about the axis in which the object fits")] = 4,
        above: Annotated[float, Field(gt=0, description="[m] of the tip over the mouth before it is lowered")] = 0.02,
        align: Metres = 0.0006,
        depth: Annotated[float, Field(gt=0, le=1, description="share of the hole's depth that is enough")] = 0.9,
        pitch: Annotated[float, Field(gt=0, description="[m] between the turns of the search")] = 0.0015,
        reach: Annotated[float, Field(gt=0, description="[m] from the mouth that the search goes")] = 0.008,
        speed: Speed = 0.4,
        lower_speed: Speed = 0.05,
        retreat: Metres = 0.1,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 200,
        bank: InsertionsFile = None,
        living: CountsFolder = None,
        pinned: Pinned = "",
    ) -> None:
        """`keys` are those at which is told what does not fit in `bank` and `pinned`."""
        self._tip, self._hole, self._mouth = tip, hole, mouth
        self._symmetry, self._above, self._align, self._depth = symmetry, above, align, depth
        self._pitch, self._reach = pitch, reach
        self._touched = np.zeros(env.num_envs)
        refuse_counts(bank, living, pinned, keys)
        self._bank: BankedInsertions | None = None
        if bank is not None:
            self._bank = BankedInsertions(env, object, tip, mouth, bank, living, pinned, keys)
        self._choice = Choice(env.num_envs, 1 if self._bank is None else self._bank.goal_count)
        arm = Arm.of(env, robot, tool=tool, solver=solver)
        super().__init__(env, arm, object, Moves(speed, lower_speed, retreat, steps))

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("transport", self._begin, self._transport, self.moves.steps),
            Phase("align", None, self._aligning, ALIGNING_STEPS + 1),
            Phase("lower", self._carry_out, self._lowering, self.moves.steps),
            Phase("search", self._touch, self._searching, SEARCHING_STEPS + 1),
            Phase("seat", None, self._seating, self.moves.steps),
            *self.let_go(),
        )

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)
        if self._bank is not None:
            self._bank.start(env_ids)

    def anew(self, env_ids: Array) -> None:
        super().anew(env_ids)
        if self._bank is not None:
            self._bank.again(env_ids)

    def retry(self, rung: Rung, env: int) -> int | None:
        """From above again where it jammed, of a bank with the next turn; else it has to be grasped again."""
        if self._bank is None:
            return 0 if rung is Rung.REPLAN else None
        if rung not in (Rung.REPLAN, Rung.CANDIDATE):
            return None
        left = self._bank.give_up(env)
        if rung is Rung.REPLAN and not left:
            self._bank.again(env)
        return 0 if left or rung is Rung.REPLAN else None

    def about(self, env: int) -> dict[str, object]:
        return super().about(env) if self._bank is None else self._bank.about(env)

    # ------------------------------------------------------------------ where the tip is, and is to be

    def _fitting(self, at: Array, offset: Array) -> Array:
        """Poses (n, 7) of the object, its tip along the hole's axes at offsets (n, 3) from the mouth."""
        thing, mouth = self.object.root.pose[at], self._mouth.pose[at]
        to_tip = P.compose(P.inverse(thing), self._tip.pose[at])
        if self._bank is not None:
            tip = self._bank.turn(self.env.scene.env_ids[at], self._tip.quaternion[at])
            point = mouth[:, :3] + P.rotate(mouth[:, 3:], offset)
            return P.compose(np.concatenate([point, tip], axis=1), P.inverse(to_tip))
        turned = P.norm(to_tip[:, 3:6]) > TURNED
        along = np.where(turned[:, None], P.multiply(thing[:, 3:], to_tip[:, 3:]), thing[:, 3:])
        seen = P.multiply(P.conjugate(mouth[:, 3:]), along)
        yaw = 2.0 * np.arctan2(seen[:, 2], seen[:, 3])
        fit = 2.0 * np.pi / self._symmetry
        half = 0.5 * fit * np.round(yaw / fit)
        zero = np.zeros_like(half)
        turn = P.multiply(mouth[:, 3:], np.stack([zero, zero, np.sin(half), np.cos(half)], axis=1))
        turn = np.where(turned[:, None], P.multiply(turn, P.conjugate(to_tip[:, 3:])), turn)
        point = mouth[:, :3] + P.rotate(mouth[:, 3:], offset)
        return np.concatenate([point - P.rotate(turn, to_tip[:, :3]), turn], axis=1)

    def _goal(self, at: Array, offset: Array) -> Array:
        """Tool poses (n, 7) with the object along the hole's axis and the tip at offsets (n, 3) from the mouth."""
        held = P.compose(P.inverse(self.object.root.pose[at]), self.arm.tool.pose[at])
        return P.compose(self._fitting(at, offset), held)

    def _ends(self, at: Array) -> tuple[Array, Array]:
        """(n, 3) offsets over the mouth and at the hole's end."""
        over, inside = np.zeros((2, len(at), 3))
        over[:, 2], inside[:, 2] = 2 * self._above, -P.norm(self._hole.position[at] - self._mouth.position[at])
        return over, inside

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        """Tool poses (n, g, 2, 7) over the mouth and at the hole's end, in grasps (n, g, 7)."""
        del ids
        over, inside = self._ends(at)
        held = P.compose(P.inverse(self.object.root.pose[at])[:, None], grasps)
        ends = [P.compose(self._fitting(at, offset)[:, None], held) for offset in (over, inside)]
        return np.stack(ends, axis=2)

    def _found(self, at: Array) -> Array:
        """(n, 3) the tip in the mouth's frame: z is below zero inside of the hole."""
        return P.rotate_inverse(self._mouth.quaternion[at], self._tip.position[at] - self._mouth.position[at])

    def _depth_of(self, at: Array) -> Array:
        """(n,) share of the hole's depth that the tip has gone."""
        deep = P.norm(self._hole.position[at] - self._mouth.position[at])
        return -self._found(at)[:, 2] / np.maximum(deep, 1e-9)

    # ------------------------------------------------------------------ phases

    def _begin(self, ids: Array, at: Array) -> None:
        self.take(ids, at)
        if self._bank is not None:
            self._choose(self._bank, ids, at)

    def _choose(self, bank: BankedInsertions, ids: Array, at: Array) -> None:
        """Of the turns that are as good as the best the one that needs the least motion."""
        good, turns = bank.good(ids), bank.turns(ids)
        tip, mouth = self._tip.pose[at], self._mouth.pose[at]
        held = P.compose(P.inverse(tip), self.arm.tool.pose[at])[:, None]
        points = [mouth[:, :3] + P.rotate(mouth[:, 3:], offset) for offset in self._ends(at)]
        ways = [np.concatenate([np.broadcast_to(p[:, None], (*turns.shape[:2], 3)), turns], axis=2) for p in points]
        tools = np.stack([P.compose(way, np.broadcast_to(held, way.shape)) for way in ways], axis=2)
        chosen = self._choice.least_motion(self.arm, ids, tools, ~good)
        bank.choose(ids, chosen, ~self._choice.none_left(ids))

    def _carry_out(self, ids: Array, at: Array) -> None:
        del at
        if self._bank is not None:
            self._bank.closed(ids)

    def _transport(self, ids: Array, at: Array) -> Array:
        """Out along the axis first where the tip is lower than it is to pass, then across."""
        found, over = self._found(at), np.zeros((len(ids), 3))
        over[:, 2] = 2 * self._above
        goal = self._goal(at, over)
        far = P.norm(found[:, :2]) > 0.03
        rise = far & (found[:, 2] < self._above)
        out = P.rotate(self._mouth.quaternion[at[rise]], np.array([0.0, 0.0, 1.0]))
        here = self.arm.command[ids[rise]]
        ahead = here[:, :3] + out * ((goal[rise, :3] - here[:, :3]) * out).sum(axis=1, keepdims=True)
        up = np.concatenate([here[:, :2], goal[rise, 2:3]], axis=1)
        goal[rise, :3], goal[rise, 3:] = np.where(out[:, 2:] > UPRIGHT, up, ahead), here[:, 3:]
        self.arm.go(ids, goal, self.moves.speed)
        said = self.held(ids, at, np.where(~far & ~rise, GO_ON, STAY))
        return said if self._bank is None else np.where(self._bank.number[ids] < 0, _NO_IK, said)

    def _aligning(self, ids: Array, at: Array) -> Array:
        over = np.zeros((len(ids), 3))
        over[:, 2] = self._above
        self.arm.go(ids, self._goal(at, over), self.moves.speed / 4)
        off = P.norm(self._found(at)[:, :2])
        ready = (self.steps[ids] >= 10) & (off < self._align) & self.slow(at, RESTING / 3)
        return self.held(ids, at, np.where(ready | (self.steps[ids] >= ALIGNING_STEPS), GO_ON, STAY))

    def _down(self, ids: Array, at: Array, aside: Array) -> None:
        """Press down along the axis, with the tip at offsets (n, 2) from it."""
        found = self._found(at)
        below = np.concatenate([aside, (found[:, 2] - 2 * GENTLE)[:, None]], axis=1)
        self.arm.go(ids, self._goal(at, below), self.moves.lower_speed, GENTLE)

    def _lowering(self, ids: Array, at: Array) -> Array:
        self._down(ids, at, np.zeros((len(ids), 2)))
        inside = self._found(at)[:, 2] < -FOUND
        touching = (self.steps[ids] >= 10) & self.arm.touching(ids, at)
        return self.held(ids, at, np.where(inside | touching, GO_ON, STAY))

    def _touch(self, ids: Array, at: Array) -> None:
        self._touched[ids] = self._found(at)[:, 2]

    def _searching(self, ids: Array, at: Array) -> Array:
        """A spiral of the tip about the mouth, pressed down, until it drops."""
        turned = TURN * self.steps[ids]
        radius = self._pitch * turned / (2 * np.pi)
        aside = np.stack([radius * np.cos(turned), radius * np.sin(turned)], axis=1)
        depth = self._found(at)[:, 2]
        self._down(ids, at, np.where((depth < -FOUND)[:, None], 0.0, aside))
        found = depth < np.minimum(self._touched[ids], 0.0) - FOUND
        inside = depth < -FOUND
        said = np.where(found | inside, GO_ON, np.where(radius > self._reach, _JAMMED, STAY))
        return self.held(ids, at, said)

    def _seating(self, ids: Array, at: Array) -> Array:
        self._down(ids, at, np.zeros((len(ids), 2)))
        deep = self._depth_of(at) >= self._depth
        stuck = (self.steps[ids] >= 40) & self.arm.touching(ids, at)
        return self.held(ids, at, np.where(deep, GO_ON, np.where(stuck, _JAMMED, STAY)))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        del env_ids
        return np.where(self._depth_of(at) >= self._depth - 0.1, GO_ON, _LOST)


_NO_IK = OUTCOMES.index(Outcome.NO_IK)
_LOST = OUTCOMES.index(Outcome.LOST)
_JAMMED = OUTCOMES.index(Outcome.JAMMED)
