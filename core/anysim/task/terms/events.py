"""Events: `(scene, draw, *, parameters)`, on reset or in each step; they act through the engine's public methods.

`draw(name, value)` gives one draw for each env at hand, `draw(name, value, where)` for those where a mask is true.
"""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math.pose import norm
from anysim.task.contract import changes_nothing_seen
from anysim.task.scene import Frame, ObjectView, SceneView
from anysim_schemas.base import NonNegative
from anysim_schemas.values import FloatValue, NonNegativeValue, Vec3Value

Draw = Callable[..., Array]


@changes_nothing_seen
def climb_levels(scene: SceneView, draw: Draw, *, frame: Frame, promote: NonNegative, demote: NonNegative) -> None:
    """The terrain's curriculum, for `when: step`: by how far a frame is from its tile's origin when an episode ends.

    At the next reset an env gets harder ground where that was more than `promote` [m], easier where it was less than
    `demote`.
    """
    if scene.terrain is None:
        raise TaskError("climb_levels needs the managers of an env")
    if scene.terrain.tiled and not scene.terrain.climbs:
        return  # each episode draws its level
    away = norm((frame.position - scene.origin[scene.rows])[:, :2])
    scene.terrain.promote(scene.env_ids, (away > promote).astype(int) - (away < demote))


@changes_nothing_seen
def push(scene: SceneView, draw: Draw, *, object: ObjectView, force: Vec3Value, every: NonNegative = 50) -> None:
    """A force [N], world axes, on an object during one control step out of `every`."""
    due = (scene.elapsed[scene.rows] % max(1, int(every))) == 0
    if not due.any():
        return
    wrench, ids = np.zeros((scene.engine.num_envs, 6)), scene.env_ids[due]
    wrench[ids, :3] = draw("force", force, due)  # an env that is not due draws nothing, whatever the others do
    for entity, own in object.by_entity(ids):
        scene.engine.apply_wrench(wrench[own, None], [entity.root], own)


@changes_nothing_seen
def set_friction(scene: SceneView, draw: Draw, *, object: ObjectView, friction: NonNegativeValue) -> None:
    """Give all surfaces of an object one friction coefficient."""
    values = np.zeros(scene.engine.num_envs)
    values[scene.env_ids] = draw("friction", friction)
    for entity, ids in object.by_entity(scene.env_ids):
        geoms = scene.index.geoms_of(entity)
        scene.engine.set_parameters("geom.friction", np.repeat(values[ids, None], len(geoms), axis=1), ids, geoms)


def visibility(
    scene: SceneView,
    draw: Draw,
    *,
    object: ObjectView,
    visible: Annotated[FloatValue, Field(description="0 hides it, 1 shows it")] = 0.0,
) -> None:
    """Hide an object from all cameras, or show it again; it is there and is felt all the same."""
    shown = np.zeros(scene.engine.num_envs)
    shown[scene.env_ids] = draw("visible", visible)
    for entity, ids in object.by_entity(scene.env_ids):
        geoms = scene.index.geoms_of(entity)
        color = scene.engine.get_parameters("geom.color", ids, geoms)
        color[..., 3] = np.array([scene.engine.world.geoms[g].color[3] for g in geoms]) * (shown[ids] > 0.5)[:, None]
        scene.engine.set_parameters("geom.color", color, ids, geoms)
