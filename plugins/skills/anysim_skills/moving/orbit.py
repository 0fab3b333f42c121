"""Orbit: carry a camera at the wrist around something, and stop at views of it."""

from collections.abc import Sequence
from functools import partial
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import WORLD, Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_skills.arm import Arm
from anysim_skills.choice import Choice
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.recovery.homing import Homing

MIDDLES, ROLLS = 8, 8
"""Directions about the target of the middle of the arc, and turns of the picture, that are tried."""
CENTRED = 0.03
"""[rad] of the optical axis from the target, in a view."""


class Orbit(PhasedSkill):
    """Carry `camera`, which is fast to the tool of `robot`, along an arc about `target`, and stop at `views` of it.

    The camera looks at the target from `radius` away, `elevation` above the horizontal, at evenly spaced directions
    over `arc`. Of where the arc can be, and how the picture can be turned, that is taken which moves the arm least; it
    fails with `no_ik` where the arm reaches all views of none.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        camera: Annotated[str, Field(description="a camera of the world that the tool carries")],
        target: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        radius: Metres = 0.3,
        elevation: Annotated[float, Field(gt=0, lt=1.57, description="[rad]")] = 0.9,
        arc: Annotated[float, Field(gt=0, le=6.2832, description="[rad] from the first view to the last")] = 1.5,
        views: Annotated[int, Field(ge=2)] = 5,
        speed: Speed = 0.2,
        hold: Annotated[int, Field(ge=1, description="control steps at each view")] = 5,
        steps: Annotated[int, Field(ge=1, description="control steps from one view to the next")] = 300,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self._target, self._camera, self._speed, self._hold, self._late = target, camera, speed, hold, steps
        world = env.engine.world
        body, holder = (
            world.cameras[env.engine.index.camera(camera)].body,
            world.sites[env.engine.index.robot(robot.name).tools[tool]].body,
        )
        if body != holder:
            carrier = "the world" if body == WORLD else f"'{world.bodies[body].name}'"
            raise TaskError(
                f"the camera '{camera}' is carried by {carrier}, and the tool '{tool}' by "
                f"'{world.bodies[holder].name}'; expected a camera that is mounted on the tool"
            )
        middle = 2 * np.pi / MIDDLES * np.arange(MIDDLES)
        azimuth = (middle[:, None] + arc * np.linspace(-0.5, 0.5, views)).reshape(MIDDLES, 1, views)
        roll = (2 * np.pi / ROLLS * np.arange(ROLLS)).reshape(1, ROLLS, 1)
        self._eyes = _looking_in(radius, elevation, *np.broadcast_arrays(azimuth, roll)).reshape(-1, views, 7)
        """(C, V, 7) poses of the camera about the target, of each arc forth."""
        n = env.num_envs
        self._choice, self._chosen = Choice(n, len(self._eyes)), np.zeros(n, dtype=np.int64)
        self._held = np.zeros(n, dtype=np.int64)
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        views = self._eyes.shape[1]
        moves = [Phase(f"view {k + 1}", self._forget, partial(self._view, number=k), self._late) for k in range(views)]
        return (Phase("choose", self._choose, self._found, 1), *moves)

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, opens=False).phases()

    def retry(self, rung: Rung, env: int) -> int | None:
        return self._choice.retry(rung, env, same=())

    def _tools(self, ids: Array, at: Array, eyes: Array) -> Array:
        """Tool poses (n, ..., 7) with which the camera is at poses about the target (n, ..., 7)."""
        mount = P.compose(P.inverse(self.env.engine.camera_poses(self._camera, ids)), self.arm.tool.pose[at])
        axes = (slice(None), *[None] * (eyes.ndim - 2))
        placed = np.concatenate([self._target.position[at][axes] + eyes[..., :3], eyes[..., 3:]], axis=-1)
        return P.compose(placed, np.broadcast_to(mount[axes], placed.shape))

    def _choose(self, ids: Array, at: Array) -> None:
        eyes = np.broadcast_to(self._eyes, (len(ids), *self._eyes.shape))
        self._chosen[ids] = self._choice.least_motion(self.arm, ids, self._tools(ids, at, eyes))

    def _found(self, ids: Array, at: Array) -> Array:
        absent = ~self._target.present[at]
        return np.where(absent, _ABSENT, np.where(self._choice.none_left(ids), _NO_IK, GO_ON))

    def _forget(self, ids: Array, at: Array) -> None:
        del at
        self._held[ids] = 0

    def _view(self, ids: Array, at: Array, number: int) -> Array:
        self.arm.go(ids, self._tools(ids, at, self._eyes[self._chosen[ids], number]), self._speed)
        self._held[ids] = (self._held[ids] + 1) * self.arm.arrived(ids, at, 0.01, CENTRED)
        return np.where(self._held[ids] >= self._hold, GO_ON, STAY)


def _looking_in(radius: float, elevation: float, azimuth: Array, roll: Array) -> Array:
    """Poses (..., 7) of cameras on a sphere about the origin that look at it, turned about their axes by `roll`."""
    flat, up = radius * np.cos(elevation), np.full(azimuth.shape, radius * np.sin(elevation))
    eyes = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), up], axis=-1)
    turn = P.from_axis_angle(np.broadcast_to(np.array([0.0, 0.0, 1.0]), eyes.shape), roll)
    return np.concatenate([eyes, P.multiply(P.look_at(eyes, np.zeros_like(eyes)), turn)], axis=-1)


_NO_IK, _ABSENT = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.ADVERSE_STATE)
