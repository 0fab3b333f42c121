"""Commands: `(scene, draw, *, parameters) -> (n, 7)` goal poses, drawn when an episode starts.

`draw(name, value)` gives one draw of a spec's value for each env at hand, from a stream of its own.
"""

from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.scene import Frame, ObjectView, SceneView
from anysim_schemas.values import FloatValue, Vec3Value

__all__ = ["goal_above", "goal_at", "goal_beside", "goal_from", "goal_pose"]

Draw = Callable[[str, Any], Array]


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
