"""Fling of cloth: two arms take two points of an edge, stretch it, swing the cloth out and lay it down.

The primitive is that of FlingBot (Ha and Song, "FlingBot: The Unreasonable Effectiveness of Dynamic Manipulation for
Cloth Unfolding", CoRL 2021).
"""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim.task.slot_frames import CategoryView
from anysim_garments.at_once import AtOnce
from anysim_garments.cloth import Cloth, Spot
from anysim_garments.grasp import ClothGrasp, Metres
from anysim_skills.arm import Arm
from anysim_skills.grasping.release import Release

LEAD = 0.16
"""[m] that commands may be ahead of the hands, which swing as fast as their drives let them."""
BEHIND = 0.12
"""[m] while the command of one arm is further ahead of its hand than this, both wait."""
LIFTING, STRETCHING = 0.5, 0.05
"""[m/s] of hands that lift cloth, and at which they then go apart."""
SLACK = 0.9
"""Of its length when flat, how far apart hands lift an edge."""
CLEAR = 0.05
"""[m] between what cloth lay on and cloth that hangs free."""
SETTLING = 10
"""Control steps for which cloth hangs before it is swung."""


class ClothFling(SkillSequence):
    """Fling `cloth` out with `robot` and `partner`, which stand side by side and take it at `at` and `partner_at`.

    They lift it until it hangs free, go apart until the edge between their hands is taut, swing it forward by `swing`
    and back, where they lay it down while they draw back, and let go. What came off a hand is taken again.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        partner: RobotView,
        cloth: CategoryView,
        at: Spot,
        partner_at: Spot,
        tool: str = "tool",
        partner_tool: Annotated[
            str, Field(description="the tool of the partner; named as the robot's where empty")
        ] = "",
        solver: str = "numba_ik",
        taut: Annotated[
            float, Field(ge=0.9, le=1, description="distance at which an edge is taut, by that when it lies flat")
        ] = 0.97,
        out: Annotated[float, Field(description="[m] from where the hands are at home to where it turns")] = 0.08,
        swing: Metres = 0.25,
        draw: Annotated[float, Field(ge=0, description="[m] that hands draw back beyond where the swing began")] = 0.03,
        pause: Annotated[float, Field(ge=0, description="[s] for which the hands rest where the swing turns")] = 0.14,
        speed: Annotated[float, Field(gt=0, le=2, description="[m/s] of the hands in the middle of the swing")] = 1.0,
        above: Metres = 0.012,
        rounds: Annotated[int, Field(ge=1, description="times that it is taken at most")] = 3,
    ) -> None:
        """`above` what it lay on the hands let go."""
        one = {"robot": robot, "tool": tool, "solver": solver}
        other = {"robot": partner, "tool": partner_tool or tool, "solver": solver}
        grasp = {
            "robot": ClothGrasp(env, **one, cloth=cloth, at=at, lift=0.0),
            "partner": ClothGrasp(env, **other, cloth=cloth, at=partner_at, lift=0.0),
        }
        members = {
            "grasp": AtOnce(env, grasp),
            "fling": _Fling(
                env, tuple(grasp.values()), taut, (out - swing, out, out - swing - draw), pause, speed, above
            ),
            "release": AtOnce(env, {"robot": Release(env, **one), "partner": Release(env, **other)}),
        }
        again = {("fling", Outcome.UNSTABLE_GRASP): "grasp"}
        super().__init__(env, members, back=again, max_attempts=rounds)


class _Fling(PhasedSkill):
    """Lift, stretch, swing and lay down cloth of which two arms hold a point each.

    Its ways are in a frame with its origin between the places where the hands are at home, on what the cloth lay on:
    side, from the partner's hand to the robot's; forward, away from the bases; up.
    """

    def __init__(
        self,
        env: TaskEnv,
        grasps: Sequence[ClothGrasp],
        taut: float,
        stations: tuple[float, float, float],
        pause: float,
        speed: float,
        above: float,
    ) -> None:
        """`stations` are where forward [m] the swing begins and turns, and where it is laid down."""
        self.arms: tuple[Arm, ...] = tuple(grasp.arm for grasp in grasps)
        self.cloth: Cloth = grasps[0].cloth
        self.numbers = np.array([grasp.numbers[0] for grasp in grasps])
        self.width, length = self.cloth.hanging(self.numbers)
        if self.width == 0.0:
            raise TaskError("cloth_fling stretches an edge, and `at` and `partner_at` are one point; give two corners")
        self._taut, self._speed = taut, speed
        self._start, self._turn, self._end = stations
        self._high, self._low = length + CLEAR, above
        self._pause = pause
        self._dt = env.engine.world.physics.control_dt
        n = env.num_envs
        self._origin, self._axes, self._turns = np.zeros((n, 3)), np.zeros((n, 2, 2)), np.zeros((n, 2, 4))
        """(N, …) where the frame is [m], its axes side and forward, and how each hand is turned."""
        self._begun, self._gap, self._share = np.zeros((n, 2, 3)), np.zeros(n), np.zeros(n)
        """(N, …) [m] where hands took it, [m] how far apart they are, and how much of a way is done."""
        super().__init__(env, self.arms)

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("reach", self._take, self._reached, 1),
            Phase("lift", self._begin, self._lifting, 400),
            Phase("stretch", None, self._stretching, 200),
            Phase("hang", None, self._hanging, SETTLING + 1),
            Phase("forward", self._begin, self._forward, 400),
            Phase("turn", None, self._turning, int(self._pause / self._dt) + 2),
            Phase("lay", self._begin, self._laying, 600),
        )

    def retry(self, rung: Rung, env: int) -> int | None:
        """None: what came off has to be taken again, and what is out of reach stays there."""
        del rung, env

    # ------------------------------------------------------------------ up

    def _take(self, ids: Array, at: Array) -> None:
        homes = np.stack([arm.home(ids) for arm in self.arms], axis=1)
        bases = np.stack([arm.robot.base.position[at] for arm in self.arms], axis=1)
        middle, side = homes[..., :2].mean(axis=1), homes[:, 0, :2] - homes[:, 1, :2]
        side /= np.maximum(P.norm(side), 1e-9)[:, None]
        forward = np.stack([-side[:, 1], side[:, 0]], axis=1)
        away = ((middle - bases[..., :2].mean(axis=1)) * forward).sum(axis=1)
        self._axes[ids] = np.stack([side, forward * np.where(away < 0, -1.0, 1.0)[:, None]], axis=1)
        self._origin[ids] = np.column_stack([middle, self.cloth.state().points[at, :, 2].min(axis=1)])
        self._turns[ids], self._gap[ids] = homes[..., 3:], SLACK * self.width
        self._begun[ids] = np.stack([arm.command[ids, :3] for arm in self.arms], axis=1)

    def _reached(self, ids: Array, at: Array) -> Array:
        """Both arms come to where the swing begins and turns, and to where it is laid down."""
        del at
        stations = (self._start, self._high), (self._turn, self._high), (self._end, self._low)
        ways = [self._places(ids, forward, up) for forward, up in stations]
        reached = np.ones(len(ids), dtype=bool)
        for number, arm in enumerate(self.arms):
            turns = self._turns[ids, number]
            poses = np.stack([np.column_stack([way[:, number], turns]) for way in ways], axis=1)
            reached &= np.isfinite(arm.effort(ids, poses[:, None])[:, 0])
        return np.where(reached, GO_ON, _NO_IK)

    def _begin(self, ids: Array, at: Array) -> None:
        del at
        self._share[ids] = 0.0

    def _lifting(self, ids: Array, at: Array) -> Array:
        begun, way = self._begun[ids], self._places(ids, self._start, self._high) - self._begun[ids]
        there = self._along(ids, at, P.norm(way).max(axis=1), LIFTING)
        self._send(ids, begun + there[:, None, None] * way)
        return self._kept(at, np.where(self._share[ids] >= 1.0, GO_ON, STAY))

    def _stretching(self, ids: Array, at: Array) -> Array:
        ends = self.cloth.state().points[at][:, self.numbers]
        taut = P.norm(ends[:, 0] - ends[:, 1]) >= self._taut * self.width
        self._gap[ids] += np.where(taut | (self._behind(ids, at) > BEHIND), 0.0, STRETCHING * self._dt)
        self._send(ids, self._places(ids, self._start, self._high))
        return self._kept(at, np.where(taut, GO_ON, STAY))

    def _hanging(self, ids: Array, at: Array) -> Array:
        return self._kept(at, np.where(self.steps[ids] >= SETTLING, GO_ON, STAY))

    # ------------------------------------------------------------------ forward, and back and down

    def _forward(self, ids: Array, at: Array) -> Array:
        way = self._turn - self._start
        there = self._along(ids, at, way, self._speed)
        self._send(ids, self._places(ids, self._start + way * there, self._high))
        return self._kept(at, np.where(self._share[ids] >= 1.0, GO_ON, STAY))

    def _turning(self, ids: Array, at: Array) -> Array:
        """The cloth swings on while the hands rest: laid down at once, it comes to lie on itself."""
        return self._kept(at, np.where(self.steps[ids] * self._dt >= self._pause - 1e-9, GO_ON, STAY))

    def _laying(self, ids: Array, at: Array) -> Array:
        back, down = self._turn - self._end, self._high - self._low
        there = self._along(ids, at, float(np.hypot(back, down)), self._speed)
        self._send(ids, self._places(ids, self._turn - back * there, self._high - down * there))
        over = self._share[ids] >= 1.0
        for arm in self.arms:
            over &= arm.arrived(ids, at, 0.01, 0.15) | arm.touching(ids, at)
        return self._kept(at, np.where(over, GO_ON, STAY))

    # ------------------------------------------------------------------ both hands

    def _places(self, ids: Array, forward: Array | float, up: Array | float) -> Array:
        """(n, 2, 3) [m] the hands in the world, so far forward and up in the frame."""
        aside = np.array([0.5, -0.5]) * self._gap[ids, None]
        along = np.broadcast_to(forward, len(ids))[:, None]
        flat = aside[..., None] * self._axes[ids, None, 0] + along[..., None] * self._axes[ids, None, 1]
        height = np.broadcast_to(np.asarray(up)[..., None], (len(ids), 2))
        return self._origin[ids, None] + np.concatenate([flat, height[..., None]], axis=2)

    def _send(self, ids: Array, places: Array) -> None:
        """Command both hands to places (n, 2, 3) on their way."""
        for number, arm in enumerate(self.arms):
            target = np.column_stack([places[:, number], self._turns[ids, number]])
            arm.go(ids, target, 2 * max(self._speed, LIFTING), LEAD)

    def _along(self, ids: Array, at: Array, long: Array | float, speed: float) -> Array:
        """(n,) from 0 to 1 along a way so long [m], so fast [m/s] in its middle; both wait for the one behind."""
        step = speed * self._dt / (np.pi / 2 * np.maximum(long, 1e-3))
        self._share[ids] = np.minimum(self._share[ids] + step * (self._behind(ids, at) < BEHIND), 1.0)
        return (1.0 - np.cos(np.pi * self._share[ids])) / 2

    def _behind(self, ids: Array, at: Array) -> Array:
        """(n,) [m] how far the hand that is further behind its command has to come up."""
        return np.maximum(*(arm.ahead(ids, at) for arm in self.arms))

    def _kept(self, at: Array, said: Array) -> Array:
        held = self.cloth.holds(at, self.numbers[0]) & self.cloth.holds(at, self.numbers[1])
        return np.where(held, said, _UNSTABLE)


_NO_IK, _UNSTABLE = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.UNSTABLE_GRASP)
