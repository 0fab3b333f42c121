"""Commands: `(scene, draw, *, parameters) -> (n, 7)` goal poses, drawn when an episode starts.

`draw(name, value)` gives one draw of a spec's value for each env at hand, from a stream of its own, and
`draw(name, value, where)` for those where a mask is true. A class with `goes_on` is asked again in each step.
"""

from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.scene import Frame, ObjectView, SceneView
from anysim_schemas.base import Number
from anysim_schemas.values import FloatValue, PositiveValue, Vec3Value

Draw = Callable[..., Array]


def _upright(position: Array) -> Array:
    return np.concatenate([position, np.tile([0.0, 0.0, 0.0, 1.0], (len(position), 1))], axis=1)


def goal_at(scene: SceneView, draw: Draw, *, position: Vec3Value) -> Array:
    """A point in the world [m]; on tiled ground relative to the env's tile."""
    return _upright(draw("position", position) + scene.origin[scene.rows])


def goal_pose(
    scene: SceneView,
    draw: Draw,
    *,
    position: Vec3Value,
    roll: FloatValue = 0.0,
    pitch: FloatValue = 0.0,
    yaw: FloatValue = 0.0,
) -> Array:
    """A pose in the world [m, rad]; on tiled ground relative to the env's tile."""
    angles = np.stack([draw("roll", roll), draw("pitch", pitch), draw("yaw", yaw)], axis=1)
    return np.concatenate(
        [draw("position", position) + scene.origin[scene.rows], P.from_roll_pitch_yaw(angles)], axis=1
    )


def goal_from(
    scene: SceneView, draw: Draw, *, frame: Frame, offset: Vec3Value = (0.0, 0.0, 0.0), yaw: FloatValue = 0.0
) -> Array:
    """A pose at an offset [m] and a turn about z [rad] from a frame, in its axes, as it is at the reset."""
    turn = P.from_axis_angle(np.array([0.0, 0.0, 1.0]), draw("yaw", yaw))
    return P.compose(frame.pose, np.concatenate([draw("offset", offset), turn], axis=1))


def _top(scene: SceneView, surface: Frame) -> Array:
    """Heights (n,) [m] of the highest point of an object as it is in each env at hand."""
    thing = ObjectView(scene, surface.name)
    top = surface.pose[:, 2].copy()
    for entity, ids in thing.by_entity(scene.env_ids):
        rows = slice(None) if len(ids) == len(scene.env_ids) else np.isin(scene.env_ids, ids)
        top[rows] = scene.entity_shape(entity.name).top_height(surface.pose[rows])
    return top


def goal_above(
    scene: SceneView, draw: Draw, *, surface: Frame, height: FloatValue, x: FloatValue = 0.0, y: FloatValue = 0.0
) -> Array:
    """A point `height` [m] above the top of an object, at x, y [m] from its centre in the object's axes.

    Where the object is not there, it counts as a point at the world's origin.
    """
    base = surface.position
    top = _top(scene, surface)
    dx, dy = draw("x", x), draw("y", y)
    yaw = 2.0 * np.arctan2(surface.quaternion[:, 2], surface.quaternion[:, 3])
    cosine, sine = np.cos(yaw), np.sin(yaw)
    position = np.stack(
        [base[:, 0] + cosine * dx - sine * dy, base[:, 1] + sine * dx + cosine * dy, top + draw("height", height)],
        axis=1,
    )
    return _upright(position)


def goal_beside(
    scene: SceneView,
    draw: Draw,
    *,
    frame: Frame,
    distance: FloatValue,
    direction: Annotated[FloatValue, Field(description="from the world's x axis [rad]")] = 0.0,
) -> Array:
    """A point at the height of a frame and `distance` [m] from it, where it is when the episode begins."""
    far, angle = draw("distance", distance), draw("direction", direction)
    along = np.stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))], axis=1)
    return _upright(frame.position + far[:, None] * along)


class GoalPath:
    """A point that moves along the line through some points, in the axes of a frame, and stays at its end.

    It starts at the first of them when the episode begins. A path that is `closed` goes on from its end to its start.
    """

    goes_on = 7

    def __init__(
        self,
        scene: SceneView,
        *,
        path: Annotated[
            Sequence[tuple[Number, Number, Number]],
            Field(min_length=2, description="[m] in the frame's axes, or the world's; on tiled ground from the tile"),
        ],
        speed: Annotated[PositiveValue, Field(description="[m/s]")],
        frame: Frame | None = None,
        closed: bool = False,
    ) -> None:
        self._scene, self._frame, self._speed, self._closed = scene, frame, speed, closed
        self._points = np.array([*path, path[0]] if closed else path)
        self._at = np.concatenate([[0.0], np.cumsum(P.norm(np.diff(self._points, axis=0)))])
        self._update, self._dt = scene.memory(), scene.engine.world.physics.control_dt

    def __call__(self, draw: Draw) -> Array:
        def begin(before: Array, first: Array) -> Array:
            speed = before.copy()
            speed[first, 0] = draw("speed", self._speed, first)
            return speed

        scene = self._scene
        far = self._update(begin)[:, 0] * scene.elapsed[scene.rows] * self._dt
        far = far % self._at[-1] if self._closed else far
        place = np.stack([np.interp(far, self._at, self._points[:, k]) for k in range(3)], axis=1)
        if self._frame is None:
            return _upright(place + scene.origin[scene.rows])
        return _upright(self._frame.position + P.rotate(self._frame.quaternion, place))
