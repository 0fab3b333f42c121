"""Predicates made of others, and those with a memory: `of` is a mapping of predicates, as under `success`.

A memory counts control steps: it is empty when an episode begins, and part of every snapshot.
"""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.joints import JointView
from anysim.task.references import Conditions, ContactView
from anysim.task.scene import Frame, SceneView
from anysim.task.terms.geometry import Axis, axis_of
from anysim_schemas.base import Number

Steps = Annotated[int, Field(ge=1, description="consecutive control steps")]


def all_(scene: SceneView, *, of: Conditions) -> Array:
    """All of them hold."""
    return of.all()


def any_(scene: SceneView, *, of: Conditions) -> Array:
    """At least one of them holds."""
    return np.logical_or.reduce(of.each())


def not_(scene: SceneView, *, of: Conditions) -> Array:
    """None of them holds."""
    return ~np.logical_or.reduce(of.each())


def k_of(scene: SceneView, *, of: Conditions, count: Annotated[int, Field(ge=1)]) -> Array:
    """At least `count` of them hold."""
    return of.each().sum(axis=0) >= count


class Hold:
    """All of them have held for so many control steps, without a break."""

    def __init__(self, scene: SceneView, *, of: Conditions, steps: Steps = 10) -> None:
        self._of, self._steps, self._update = of, steps, scene.memory()

    def __call__(self) -> Array:
        return self._update(lambda before, first: (before + 1) * self._of.all()[:, None])[:, 0] >= self._steps


class ForceOver:
    """A contact sensor has felt more than `limit` for so many control steps, without a break."""

    def __init__(
        self,
        scene: SceneView,
        *,
        sensor: ContactView,
        limit: Annotated[float, Field(gt=0, description="[N]")],
        steps: Steps = 3,
    ) -> None:
        self._sensor, self._limit, self._steps, self._update = sensor, limit, steps, scene.memory()

    def __call__(self) -> Array:
        over = self._update(lambda before, first: (before + 1) * (self._sensor.strength > self._limit)[:, None])
        return over[:, 0] >= self._steps


class After:
    """All of `of` hold now, and all of `first` did at once, in this control step of the episode or an earlier one."""

    def __init__(self, scene: SceneView, *, first: Conditions, of: Conditions) -> None:
        self._first, self._of, self._update = first, of, scene.memory()

    def __call__(self) -> Array:
        was = self._update(lambda before, first: np.maximum(before, self._first.all()[:, None]))
        return (was[:, 0] > 0) & self._of.all()


class Turned:
    """A frame has turned about one of its axes by at least an angle since the episode's first step, turns counted.

    The axis should stay where it is in the world, and the frame turn by less than half a turn in a control step.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        frame: Frame,
        angle: Annotated[float, Field(description="[rad]; a negative one counts turns the other way")],
        axis: Axis = "z",
    ) -> None:
        self._frame, self._angle = frame, angle
        self._axis: Axis = axis
        self._update = scene.memory(5)  # the quaternion before, and the sum

    def __call__(self) -> Array:
        total = self._update(self._turn)[:, 4]
        return total >= self._angle if self._angle >= 0 else total <= self._angle

    def _turn(self, before: Array, first: Array) -> Array:
        now = self._frame.quaternion
        last = np.where(first[:, None], now, before[:, :4])
        step = P.rotation_vector(P.multiply(now, P.conjugate(last)))
        return np.concatenate([now, before[:, 4:] + P.dot(step, axis_of(now, self._axis))[:, None]], axis=1)


class Followed:
    """A frame has passed the points of a path one after the other, each within `tolerance`; it has come to the last."""

    def __init__(
        self,
        scene: SceneView,
        *,
        frame: Frame,
        b: Frame,
        path: Annotated[
            Sequence[tuple[Number, Number, Number]], Field(min_length=1, description="points in the axes of b [m]")
        ],
        tolerance: Annotated[float, Field(gt=0, description="[m]")] = 0.02,
    ) -> None:
        self._frame, self._base, self._tolerance = frame, b, tolerance
        self._path, self._update = np.array(path), scene.memory()

    def __call__(self) -> Array:
        return self._update(self._pass)[:, 0] >= len(self._path)

    def _pass(self, before: Array, first: Array) -> Array:
        place = P.rotate_inverse(self._base.quaternion, self._frame.position - self._base.position)
        due = self._path[np.minimum(before[:, 0].astype(int), len(self._path) - 1)]
        return before + (P.norm(place - due) <= self._tolerance)[:, None]


class JointMoved:
    """A joint has moved by at least so much since the episode's first step, upwards; downwards where it is negative."""

    def __init__(
        self, scene: SceneView, *, joint: JointView, by: Annotated[float, Field(description="[rad, m]")]
    ) -> None:
        self._joint, self._by, self._update = joint, by, scene.memory()

    def __call__(self) -> Array:
        position = self._joint.position
        begun = self._update(lambda before, first: np.where(first[:, None], position[:, None], before))
        moved = position - begun[:, 0]
        return moved >= self._by if self._by >= 0 else moved <= self._by
