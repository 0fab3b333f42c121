"""Scooping of grains: a held scoop goes down into a bed of them, is drawn through it, and comes up full."""

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
from anysim_matter.held_scoop import HeldScoop, Metres, Speed, Steps, inside
from anysim_skills.arm import Arm
from anysim_skills.choice import Choice
from anysim_skills.object_shapes import ObjectShapes

ASKEW = np.array([0.0, 0.15, -0.15])
"""[rad] by which it may be drawn askew to the longer side of what the bed is in."""
HEADINGS = 2 * len(ASKEW)
SURFACE = 0.8
"""Share of the grains that lie below the surface of a bed, as a scoop sees it."""
OVER = 0.02
"""[m] of its front edge above what the bed is in, before it goes down."""
RAISED = 0.01
"""[m] that its front edge comes up while it is levelled, so that its handle does not come down on a wall."""
SETTLING = 15
"""Control steps in which what does not lie well in it falls off."""
DIGGING = 80
"""Control steps after which it goes on as far as it came: grains bear it."""


class Scoop(PhasedSkill):
    """Fill the held `scoop` with `contents` of the object `source`, and lift it.

    The scoop's z goes up out of its opening, its x to its front, whose edge is `front` before its origin. It goes down
    with its front first, tilted by `angle`, to `depth` below the surface, is drawn through the bed over `stroke`
    along the longer side of `source`, and is levelled and lifted. What counts is how many of the contents are in it.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        scoop: ObjectView,
        source: ObjectView,
        contents: CategoryView,
        front: Metres,
        least: Annotated[int, Field(ge=1, description="of the contents that are to be in the scoop")] = 10,
        angle: Annotated[float, Field(gt=0, lt=1.6, description="[rad]")] = 0.8,
        carried: Annotated[float, Field(ge=0, lt=0.6, description="[rad] its front is up when it is lifted")] = 0.15,
        depth: Metres = 0.03,
        floor: Annotated[float, Field(ge=0, description="[m] of its front over the bottom of `source`")] = 0.012,
        stroke: Metres = 0.05,
        lift: Metres = 0.12,
        tool: str = "tool",
        solver: str = "numba_ik",
        speed: Speed = 0.2,
        steps: Steps = 300,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self._held = HeldScoop(self.arm, scoop, contents, front)
        self._source, self._contents, self._bed = source, contents, ObjectShapes(env.scene, source)
        self._least, self._angle, self._depth, self._floor = least, angle, depth, floor
        self._carried, self._stroke, self._lift, self._speed, self._late = carried, stroke, lift, speed, steps
        n = env.num_envs
        self._choice = Choice(n, HEADINGS)
        self._heading, self._edge = np.zeros(n), np.zeros((n, 5, 3))
        """(N, …) [rad] where it is drawn to, and where its edge goes [m]."""
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("choose", self._choose, self._chosen, 1),
            Phase("rise", None, self._rise, self._late),
            Phase("over", None, self._over, self._late),
            Phase("dig", None, self._dig, self._late),
            Phase("draw", None, self._draw, self._late),
            Phase("level", None, self._level, self._late),
            Phase("lift", None, self._raise, self._late),
            Phase("settle", None, self._settle, SETTLING + 1),
        )

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def retry(self, rung: Rung, env: int) -> int | None:
        """Once more where too little is in it; another direction where the arm did not come along the first."""
        again = rung is Rung.RESAMPLE or (rung is Rung.CANDIDATE and self._choice.next(env))
        return 0 if again else None

    def loaded(self, ids: Array, at: Array) -> Array:
        """(n,) how many of the contents are in the scoop, in rows `at` of the scene."""
        return self._held.loaded(ids, at)

    def _in_bed(self, ids: Array, at: Array) -> Array:
        """(n, P) bool: which of the contents are within the bounds of `source`."""
        return inside(self._contents, at, self._source.root.pose[at], *self._bed.box(ids))

    def _edges(self, ids: Array, at: Array, heading: Array) -> Array:
        """(n, g, 5, 3) of its front edge over the bed, in it, drawn, level, and lifted, along headings (n, g) [rad]."""
        low, high = self._bed.box(ids)
        frame, height = self._source.root.pose[at], self._contents.positions[at][..., 2]
        surface = [np.quantile(row[own], SURFACE) for row, own in zip(height, self._in_bed(ids, at), strict=True)]
        bottom = np.maximum(np.array(surface) - self._depth, frame[:, 2] + low[:, 2] + self._floor)
        way = np.stack([np.cos(heading), np.sin(heading), 0 * heading], axis=-1)
        middle = (frame[:, :3] + P.rotate(frame[:, 3:], 0.5 * (low + high)))[:, None]
        edges = np.stack([middle + share * self._stroke * way for share in (-0.5, -0.5, 0.5, 0.5, 0.5)], axis=2)
        top = frame[:, 2] + high[:, 2]
        edges[..., 2] = np.stack([top + OVER, bottom, bottom, bottom + RAISED, top + self._lift], axis=1)[:, None]
        return edges

    def _tilts(self) -> tuple[float, ...]:
        return self._angle, self._angle, self._angle, 0.0, -self._carried

    def _goal(self, ids: Array, station: int) -> Array:
        """(n, 7) of the chosen heading."""
        tilt = self._tilts()[station]
        return self._held.tools(ids, self._heading[ids, None], self._edge[ids, station][:, None], tilt)[:, 0]

    # ------------------------------------------------------------------ phases

    def _choose(self, ids: Array, at: Array) -> None:
        """The heading along which the arm moves least."""
        self._held.take(ids, at)
        full = self._in_bed(ids, at).any(axis=1)
        if not full.any():
            return
        ids, at = ids[full], at[full]
        size = self._bed.size(ids)
        side = P.yaw(self._source.root.quaternion[at]) + np.where(size[:, 1] > size[:, 0], np.pi / 2, 0.0)
        heading = side[:, None] + np.concatenate([ASKEW, ASKEW + np.pi])
        edges = self._edges(ids, at, heading)
        stations = enumerate(self._tilts())
        ways = [self._held.tools(ids, heading, edges[:, :, station], tilt) for station, tilt in stations]
        number = self._choice.least_motion(self.arm, ids, np.stack(ways, axis=2))
        rows = np.arange(len(ids))
        self._heading[ids], self._edge[ids] = heading[rows, number], edges[rows, number]

    def _chosen(self, ids: Array, at: Array) -> Array:
        left = self._in_bed(ids, at).sum(axis=1)
        return np.where(left < self._least, _ADVERSE, np.where(self._choice.none_left(ids), _NO_IK, GO_ON))

    def _rise(self, ids: Array, at: Array) -> Array:
        return self._held.rise(ids, at, self._goal(ids, 4)[:, 2], self._speed)

    def _over(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._goal(ids, 0), self._speed)
        return self._held.went(ids, at, 0.01)

    def _dig(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._goal(ids, 1), self._speed / 2)
        return self._held.went(ids, at, 0.008, self.steps[ids] >= DIGGING)

    def _draw(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._goal(ids, 2), self._speed / 2)
        return self._held.went(ids, at, 0.008, self.steps[ids] >= DIGGING)

    def _level(self, ids: Array, at: Array) -> Array:
        """About its front edge, which hardly moves, so that little slides out."""
        self.arm.go(ids, self._goal(ids, 3), self._speed / 2)
        return self._held.went(ids, at, 0.01, self.steps[ids] >= DIGGING)

    def _raise(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._goal(ids, 4), self._speed / 2)
        return self._held.went(ids, at, 0.02)

    def _settle(self, ids: Array, at: Array) -> Array:
        return np.where(self.steps[ids] >= SETTLING, self._held.went(ids, at, 0.03), STAY)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        return np.where(self.loaded(env_ids, at) >= self._least, GO_ON, _MISSED)


_NO_IK, _ADVERSE = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.ADVERSE_STATE)
_MISSED = OUTCOMES.index(Outcome.MISSED_CONTACT)
