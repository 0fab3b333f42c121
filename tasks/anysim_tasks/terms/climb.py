"""The curriculum of ground for what walks as it is told: by how far it came, of what it was told to."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math.pose import norm
from anysim.task.contract import changes_nothing_seen
from anysim.task.scene import Frame, SceneView
from anysim_tasks.terms.velocity import VelocityView

Draw = Callable[..., Array]


@changes_nothing_seen
class Climb:
    """For `when: step`: harder ground next for what left its tile, easier ground for what lagged behind its command.

    At the next reset an env is promoted where a frame is further from its tile's origin than `promote` edges of a tile.
    Otherwise it is demoted where that is less than `demote` of how far its commands lead, turns included; those of an
    episode that ends early count as if they went on at the same rate: to fall is to lag. Where each episode draws its
    level, nothing happens.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        frame: Frame,
        goal: VelocityView,
        promote: Annotated[float, Field(gt=0, description="edges of a tile")] = 0.5,
        demote: Annotated[float, Field(ge=0, le=1, description="share of how far the commands lead")] = 0.5,
    ) -> None:
        if scene.terrain is None or not scene.terrain.tiled or scene.terrain.spec.task is None:
            raise TaskError("the ground has no levels to climb; world.terrain needs `kind: tiles`")
        spec = scene.terrain.spec
        self._scene, self._terrain, self._frame, self._goal = scene, scene.terrain, frame, goal
        self._far = promote * spec.world.terrain.tiling.size
        self._near, self._horizon, self._dt = demote, scene.terrain.spec.task.horizon, spec.physics.control_dt
        self._update = scene.memory(3)  # where the commands so far lead [m, m, rad]

    def __call__(self, draw: Draw) -> None:
        del draw
        if not self._terrain.climbs:
            return
        scene = self._scene
        led = norm(self._update(self._follow)[:, :2]) * self._horizon / np.maximum(scene.elapsed[scene.rows], 1)
        away = norm((self._frame.position - scene.origin[scene.rows])[:, :2])
        up, down = away > self._far, away < self._near * led
        self._terrain.promote(scene.env_ids, up.astype(int) - (down & ~up))

    def _follow(self, before: Array, first: Array) -> Array:
        forward, left, turn = self._dt * self._goal.value.T
        cosine, sine = np.cos(before[:, 2]), np.sin(before[:, 2])
        moved = forward * cosine - left * sine, forward * sine + left * cosine, turn
        return before + np.stack(moved, axis=1)
