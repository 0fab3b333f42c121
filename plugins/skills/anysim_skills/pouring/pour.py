"""Pour: tilt a held vessel over another one until what is in it has gone there."""

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
from anysim_skills.arm import Arm
from anysim_skills.choice import Choice
from anysim_skills.grasping.grasp import Speed
from anysim_skills.object_shapes import ObjectShapes

HEADINGS = 8
"""Turns of the vessel about the vertical that are tried."""
LIPS = 8
"""Points of its rim that are tried as the lip."""
AT_HAND = 0.5
"""Cosine of the angle to the hand below which a point of the rim is no lip: it would pour over the fingers."""
STATIONS = 3
"""Tilts at which the hand's pose must be reachable."""
DRAIN_STEPS = 60
"""Control steps that it waits, fully tilted, for what is still in it."""

Angle = Annotated[float, Field(gt=0, lt=3.2, description="[rad]")]
Share = Annotated[float, Field(gt=0, le=1)]


class Pour(PhasedSkill):
    """Pour `contents` out of the held `vessel` into the object `into`.

    The vessel's z goes through the middle of its opening, which is as high as it is.
    The lip goes over the middle of `into` and comes down as the vessel is tilted about it at `rate`. What counts is how
    many of the contents lie within the bounds of `into` at the end.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        vessel: ObjectView,
        into: ObjectView,
        contents: CategoryView,
        tool: str = "tool",
        solver: str = "numba_ik",
        radius: Annotated[float, Field(gt=0, description="[m] of the rim")] = 0.03,
        above: Annotated[float, Field(gt=0, description="[m] of the lip over the highest point of `into`")] = 0.04,
        short: Annotated[float, Field(ge=0, description="[m] of the middle, as what pours out flies on")] = 0.03,
        angle: Angle = 2.2,
        rate: Annotated[float, Field(gt=0, description="[rad/s] of the tilt")] = 0.7,
        amount: Share = 0.8,
        speed: Speed = 0.25,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 300,
    ) -> None:
        """`amount` is the share of the contents that is to be in `into`."""
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self._vessel, self._into, self._contents = vessel, into, contents
        self._radius, self._above, self._short = radius, above, short
        self._angle, self._amount, self._speed, self._late = angle, amount, speed, steps
        self._step = rate * env.engine.world.physics.control_dt
        self._shapes, self._own = ObjectShapes(env.scene, into), ObjectShapes(env.scene, vessel)
        n = env.num_envs
        self._choice = Choice(n, HEADINGS * LIPS)
        self._heading, self._lip, self._tilt = np.zeros((3, n))
        """(N,) [rad] where it pours to in the world, where the lip is on the rim, and how far it is tilted."""
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        tilting = int(2 * self._angle / self._step) + DRAIN_STEPS
        return (
            Phase("choose", self._choose, self._chosen, 1),
            Phase("rise", None, self._rise, self._late),
            Phase("carry", None, self._carry, self._late),
            Phase("tilt", None, self._tilting, tilting),
            Phase("upright", None, self._righting, tilting),
        )

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def retry(self, rung: Rung, env: int) -> int | None:
        """Another lip or heading where the way was at fault; what is not held any more has to be grasped again."""
        return 0 if rung is Rung.CANDIDATE and self._choice.next(env) else None

    def poured(self, ids: Array, at: Array) -> Array:
        """(n,) share of the contents that are within the bounds of `into`."""
        into, place = self._into.root.pose[at][:, None], self._contents.positions[at]
        turn = np.broadcast_to(into[..., 3:], (*place.shape[:-1], 4))
        seen = P.rotate_inverse(turn, place - into[..., :3])
        low, high = self._shapes.box(ids)
        there = ((seen >= low[:, None]) & (seen <= high[:, None])).all(axis=2) & self._contents.present[at]
        return there.sum(axis=1) / np.maximum(self._contents.present[at].sum(axis=1), 1)

    # ------------------------------------------------------------------ where the vessel is to be

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        """Tool poses (n, g, c, m, 7) of all headings and lips away from the hand, the steepest first, in grasps."""
        count, (n, g) = HEADINGS * LIPS, grasps.shape[:2]
        headings, lips = (np.broadcast_to(options, (n, count)) for options in _options())
        grip = P.compose(P.inverse(self._vessel.root.pose[at])[:, None], grasps)[:, :, None]
        ways = np.zeros((n, g, count, STATIONS, 7))
        for station, tilt in enumerate(self._tilts()[::-1]):
            vessel = self._vessels(ids, at, headings, lips, np.full((n, count), tilt))[:, None]
            ways[:, :, :, station] = P.compose(*np.broadcast_arrays(vessel, grip))
        ways[self._over_hand(at, grasps[..., 3:])] = np.nan
        return ways

    def _tilts(self) -> Array:
        return np.linspace(0.0, self._angle, STATIONS)

    def _tools(self, ids: Array, at: Array, heading: Array, lip: Array, tilt: Array) -> Array:
        """Tool poses (n, g, 7) that hold the vessel tilted (n, g) [rad] towards headings, a lip over the target."""
        grip = P.compose(P.inverse(self._vessel.root.pose[at]), self.arm.tool.pose[at])[:, None]
        vessel = self._vessels(ids, at, heading, lip, tilt)
        return P.compose(vessel, np.broadcast_to(grip, vessel.shape))

    def _vessels(self, ids: Array, at: Array, heading: Array, lip: Array, tilt: Array) -> Array:
        """Where the vessel then is (n, g, 7)."""
        zero = np.zeros_like(tilt)
        level = np.stack([-np.sin(heading), np.cos(heading), zero], axis=-1)
        upright = P.from_axis_angle(np.broadcast_to([0.0, 0.0, 1.0], (*tilt.shape, 3)), heading - lip)
        turn = P.multiply(P.from_axis_angle(level, tilt), upright)
        top = np.broadcast_to(self._own.box(ids)[1][:, 2:], tilt.shape)
        at_lip = np.stack([self._radius * np.cos(lip), self._radius * np.sin(lip), top], axis=-1)
        way = np.stack([np.cos(heading), np.sin(heading), zero], axis=-1)
        place = self._target(ids, at)[:, None] - self._short * way - P.rotate(turn, at_lip)
        place[..., 2] += top * np.maximum(np.cos(tilt), 0.0)  # what hangs below the lip passes over the target too
        return np.concatenate([place, turn], axis=-1)

    def _target(self, ids: Array, at: Array) -> Array:
        """(n, 3) [m] over the middle of `into`."""
        low, high = self._shapes.box(ids)
        into = self._into.root.pose[at]
        place = into[:, :3] + P.rotate(into[:, 3:], 0.5 * (low + high))
        place[:, 2] += 0.5 * (high - low)[:, 2] + self._above
        return place

    def _chosen_tools(self, ids: Array, at: Array, tilt: Array) -> Array:
        """(n, 7) with the chosen heading and lip."""
        return self._tools(ids, at, self._heading[ids, None], self._lip[ids, None], tilt[:, None])[:, 0]

    # ------------------------------------------------------------------ phases

    def _choose(self, ids: Array, at: Array) -> None:
        """The heading and lip that are reached with the least motion, away from the hand."""
        self.arm.take(ids, at, self._vessel.root)
        self._tilt[ids] = 0.0
        heading, lip = _options()
        n, g = len(ids), HEADINGS * LIPS
        headings, lips = np.broadcast_to(heading, (n, g)), np.broadcast_to(lip, (n, g))
        targets = [self._tools(ids, at, headings, lips, np.full((n, g), tilt)) for tilt in self._tilts()]
        targets = np.stack(targets, axis=2)
        effort = self.arm.effort(ids, targets)
        effort[self._over_hand(at, self.arm.tool.quaternion[at][:, None])[:, 0]] = np.inf
        number = self._choice.choose(ids, effort)
        self._heading[ids], self._lip[ids] = heading[number], lip[number]

    def _over_hand(self, at: Array, tools: Array) -> Array:
        """(n, g, c) bool of hands turned as (n, g, 4): options whose lip is on the side of the hand."""
        out = P.rotate(tools, np.broadcast_to(np.array([0.0, 0.0, -1.0]), (*tools.shape[:2], 3)))
        seen = P.rotate_inverse(np.broadcast_to(self._vessel.root.quaternion[at][:, None], tools.shape), out)
        lip = _options()[1]
        return seen[..., :1] * np.cos(lip) + seen[..., 1:2] * np.sin(lip) > AT_HAND

    def _chosen(self, ids: Array, at: Array) -> Array:
        empty = ~self._contents.present[at].any(axis=1)
        return np.where(empty, _ADVERSE, np.where(self._choice.none_left(ids), _NO_IK, GO_ON))

    def _held(self, ids: Array, at: Array, said: Array) -> Array:
        return np.where(self.arm.holds(ids, at, self._vessel.root), said, _UNSTABLE)

    def _rise(self, ids: Array, at: Array) -> Array:
        """Straight up to the height at which it is carried across."""
        goal = self._chosen_tools(ids, at, self._tilt[ids])
        up = self.arm.target[ids].copy()
        up[:, 2] = np.maximum(goal[:, 2], self.arm.command[ids, 2])
        self.arm.go(ids, up, self._speed)
        return self._held(ids, at, np.where(self.arm.tool.position[at, 2] > goal[:, 2] - 0.02, GO_ON, STAY))

    def _carry(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._chosen_tools(ids, at, self._tilt[ids]), self._speed)
        return self._held(ids, at, np.where(self.arm.arrived(ids, at, 0.01, 0.08), GO_ON, STAY))

    def _tilting(self, ids: Array, at: Array) -> Array:
        """On until it is poured out; then a moment for what is still on its way."""
        self._tilt[ids] = np.minimum(self._tilt[ids] + self._step, self._angle)
        self.arm.go(ids, self._chosen_tools(ids, at, self._tilt[ids]), self._speed)
        drained = self.steps[ids] >= self._angle / self._step + DRAIN_STEPS
        return self._held(ids, at, np.where(drained | (self.poured(ids, at) >= 1.0), GO_ON, STAY))

    def _righting(self, ids: Array, at: Array) -> Array:
        self._tilt[ids] = np.maximum(self._tilt[ids] - self._step, 0.0)
        self.arm.go(ids, self._chosen_tools(ids, at, self._tilt[ids]), self._speed)
        back = (self._tilt[ids] == 0.0) & self.arm.arrived(ids, at, 0.02, 0.15)
        return self._held(ids, at, np.where(back, GO_ON, STAY))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        return np.where(self.poured(env_ids, at) >= self._amount, GO_ON, _LOST)


def _options() -> tuple[Array, Array]:
    """(c,) [rad] headings and lips that are tried."""
    heading = np.repeat(2 * np.pi / HEADINGS * np.arange(HEADINGS), LIPS)
    return heading, np.tile(2 * np.pi / LIPS * np.arange(LIPS), HEADINGS)


_NO_IK, _ADVERSE = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.ADVERSE_STATE)
_UNSTABLE, _LOST = OUTCOMES.index(Outcome.UNSTABLE_GRASP), OUTCOMES.index(Outcome.LOST)
