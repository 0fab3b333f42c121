"""FlyLook and FlyOrbit: carry a flying camera to views of something, one or several around it."""

from collections.abc import Sequence
from functools import partial
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_cameras.fly_to import NO_PATH, Clearance, Flight, Planner, Steps

AZIMUTHS = 16
"""Directions of views that are looked at, for each elevation."""
Views = Annotated[int, Field(ge=2, description="at evenly spaced directions")]
Metres = Annotated[float, Field(gt=0, description="[m] from the target")]


class FlyLook(Flight):
    """Carry a flying camera to the nearest view of `target` from `distance` away, past what would hide it.

    The way from the view to within `radius` of the target is one that the camera itself could fly, so that nothing
    stands in it.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        target: Frame,
        distance: Metres = 0.7,
        elevations: Annotated[tuple[float, ...], Field(min_length=1, description="[rad]")] = (0.3, 0.6, 0.9, 1.2),
        radius: Annotated[float, Field(gt=0, description="[m] of the target, which may be touched")] = 0.2,
        planner: Planner = "rrt",
        clearance: Clearance = 0.03,
        steps: Steps = 900,
    ) -> None:
        self._target, self._distance, self._elevations, self._radius = target, distance, elevations, radius
        super().__init__(env, robot, planner, clearance, steps)
        self._none = np.zeros(env.num_envs, dtype=bool)

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("look", self._choose, self._look, self._late),)

    def _choose(self, ids: Array, at: Array) -> None:
        places = self.eye.joints(ids)[0]
        for env, place, point in zip(ids.tolist(), places, self.eye.local(at, self._target.position[at]), strict=True):
            ways = _around(self._elevations, AZIMUTHS)
            eyes = point + self._distance * ways
            order = np.argsort(P.norm(eyes - place), kind="stable")
            self._none[env] = not any(
                self.eye.free(env, eyes[k], point + self._radius * ways[k])
                and self.set_out(env, eyes[k], self.eye.towards(eyes[k][None], point[None])[0])
                for k in order
            )

    def _look(self, ids: Array, at: Array) -> Array:
        self.go_on(ids)
        points = self.eye.local(at, self._target.position[at])
        self.eye.angles[ids] = self.eye.towards(self.eye.joints(ids)[0], points)
        said = np.where(self.there(ids, 0.01, 0.01), GO_ON, STAY)
        return np.where(self._none[ids], NO_PATH, said)


class FlyOrbit(Flight):
    """Carry a flying camera around `target`, and stop at `views` of it all around, the nearest one first."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        target: Frame,
        radius: Metres = 0.8,
        elevation: Annotated[float, Field(ge=0, lt=1.57, description="[rad]")] = 0.5,
        views: Views = 8,
        hold: Annotated[int, Field(ge=1, description="control steps at each view")] = 10,
        planner: Planner = "",
        clearance: Clearance = 0.03,
        steps: Steps = 300,
    ) -> None:
        self._target, self._views, self._hold = target, views, hold
        flat, up = radius * np.cos(elevation), radius * np.sin(elevation)
        self._flat, self._up = flat, up
        self._first, self._held = np.zeros(env.num_envs), np.zeros(env.num_envs, dtype=np.int64)
        self._none = np.zeros(env.num_envs, dtype=bool)
        super().__init__(env, robot, planner, clearance, steps)

    def make_phases(self) -> Sequence[Phase]:
        return [
            Phase(f"view {k + 1}", partial(self._begin, number=k), self._view, self._late) for k in range(self._views)
        ]

    def _begin(self, ids: Array, at: Array, number: int) -> None:
        places, points = self.eye.joints(ids)[0], self.eye.local(at, self._target.position[at])
        if number == 0:
            way = places - points
            self._first[ids] = np.arctan2(way[:, 1], way[:, 0])
        self._held[ids] = 0
        for env, point in zip(ids.tolist(), points, strict=True):
            azimuth = self._first[env] + 2 * np.pi * number / self._views
            eye = point + np.array([self._flat * np.cos(azimuth), self._flat * np.sin(azimuth), self._up])
            self._none[env] = not self.set_out(env, eye, self.eye.towards(eye[None], point[None])[0])

    def _view(self, ids: Array, at: Array) -> Array:
        self.go_on(ids)
        points = self.eye.local(at, self._target.position[at])
        self.eye.angles[ids] = self.eye.towards(self.eye.joints(ids)[0], points)
        self._held[ids] = (self._held[ids] + 1) * self.there(ids, 0.02, 0.02)
        said = np.where(self._held[ids] >= self._hold, GO_ON, STAY)
        return np.where(self._target.present[at], np.where(self._none[ids], NO_PATH, said), _ABSENT)


def _around(elevations: Sequence[float], azimuths: int) -> Array:
    """Directions (e * a, 3) from something to views of it."""
    up, round_ = np.meshgrid(np.array(elevations), 2 * np.pi / azimuths * np.arange(azimuths), indexing="ij")
    level = np.cos(up)
    return np.stack([level * np.cos(round_), level * np.sin(round_), np.sin(up)], axis=-1).reshape(-1, 3)


_ABSENT = OUTCOMES.index(Outcome.ADVERSE_STATE)
