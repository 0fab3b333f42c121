"""Terms of bases near people and things: which way one faces, how near it is, and whether it has kept behind."""

from collections.abc import Callable, Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.scene import Frame, RobotView, SceneView
from anysim_mobile.separation import Separation

Entity = Annotated[str, Field(description="an entity, such as a person or an object")]


def _bearing(a: Frame, b: Frame) -> Array:
    """(n,) [rad] between the x axis of a and the direction to b, over the ground."""
    way = b.position[:, :2] - a.position[:, :2]
    return np.abs(P.wrapped(np.arctan2(way[:, 1], way[:, 0]) - P.yaw(a.quaternion)))


def bearing(scene: SceneView, *, a: Frame, b: Frame) -> Array:
    """Angle over the ground between the x axis of a and the direction to b [rad]."""
    del scene
    return _bearing(a, b)


def faces(
    scene: SceneView, *, a: Frame, b: Frame, tolerance: Annotated[float, Field(gt=0, description="[rad]")] = 0.2
) -> Array:
    """The x axis of a points to b, over the ground."""
    del scene
    return _bearing(a, b) <= tolerance


class NearerThan:
    """Seen from above, less than `distance` is left between the rectangle around a robot and an entity."""

    def __init__(
        self,
        scene: SceneView,
        *,
        robot: RobotView,
        entity: Entity,
        distance: Annotated[float, Field(gt=0, description="[m]")],
    ) -> None:
        self._separation, self._distance = Separation(scene, robot, [entity]), distance

    def __call__(self) -> Array:
        return self._separation.nearest() < self._distance


class Gap:
    """What is left between the rectangle around a robot and an entity, seen from above [m], at most `limit`."""

    def __init__(
        self,
        scene: SceneView,
        *,
        robot: RobotView,
        entity: Entity,
        limit: Annotated[float, Field(gt=0, description="[m]")] = 5.0,
    ) -> None:
        self._separation, self._limit = Separation(scene, robot, [entity]), limit

    def __call__(self) -> Array:
        return np.minimum(self._separation.nearest(), self._limit)[:, None]


class Followed:
    """For a share of the time, once a frame first has, a has been between two distances behind b, and has faced it."""

    def __init__(
        self,
        scene: SceneView,
        *,
        a: Frame,
        b: Frame,
        distance: Annotated[tuple[float, float], Field(description="[m] least and most over the ground")] = (1.0, 2.0),
        angle: Annotated[float, Field(gt=0, description="[rad]")] = 0.5,
        share: Annotated[float, Field(gt=0, le=1)] = 0.9,
        after: Annotated[float, Field(ge=0, description="since the episode's beginning [s]")] = 0.0,
    ) -> None:
        self._a, self._b, self._distance, self._angle, self._share = a, b, distance, angle, share
        self._scene, self._steps = scene, round(after / scene.engine.world.physics.control_dt)
        self._update = scene.memory(2)  # control steps that count, and those in which it was behind and faced it

    def __call__(self) -> Array:
        seen = self._update(self._pass)
        now = self._kept()
        long = self._scene.elapsed[self._scene.rows] >= self._steps
        return long & now & (seen[:, 1] >= self._share * seen[:, 0])

    def _kept(self) -> Array:
        apart = P.norm(self._b.position[:, :2] - self._a.position[:, :2])
        low, high = self._distance
        return (apart >= low) & (apart <= high) & (_bearing(self._a, self._b) <= self._angle)

    def _pass(self, before: Array, first: Array) -> Array:
        del first
        kept = self._kept()
        counts = kept | (before[:, 0] > 0)
        return before + np.stack([counts, kept], axis=1)


TERMS: Mapping[str, Mapping[str, Callable[..., object]]] = {
    "observation": {"gap": Gap},
    "reward": {"bearing": bearing},
    "predicate": {"faces": faces, "followed": Followed, "nearer_than": NearerThan},
}
