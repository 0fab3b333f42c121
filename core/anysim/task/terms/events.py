"""Events: `(scene, draw, *, parameters)`, on reset or in each step; they act through the engine's public methods.

`draw(name, value)` gives one draw for each env at hand, `draw(name, value, where)` for those where a mask is true.
"""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.task.view import ObjectView, SceneView
from anysim_schemas.base import NonNegative
from anysim_schemas.values import NonNegativeValue, Vec3Value

__all__ = ["push", "set_friction"]

Draw = Callable[..., Array]


def push(scene: SceneView, draw: Draw, *, object: ObjectView, force: Vec3Value, every: NonNegative = 50) -> None:
    """A force [N], world axes, on an object during one control step out of `every`."""
    due = (scene.elapsed[scene.rows] % max(1, int(every))) == 0
    if not due.any():
        return
    force_rows = draw("force", force, due)  # an env that is not due draws nothing, whatever the others do
    wrench = np.concatenate([force_rows, np.zeros_like(force_rows)], axis=1)
    scene.engine.apply_wrench(wrench[:, None], [object.entity.root], scene.env_ids[due])


def set_friction(scene: SceneView, draw: Draw, *, object: ObjectView, friction: NonNegativeValue) -> None:
    """Give all surfaces of an object one friction coefficient."""
    geoms = scene.index.geoms_of(object.entity)
    rows = draw("friction", friction)
    scene.engine.set_parameters("geom.friction", np.repeat(rows[:, None], len(geoms), axis=1), scene.env_ids, geoms)
