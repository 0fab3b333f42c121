"""An engine's own rays in place of the geometry module, for sensors with `source: engine`."""

from collections.abc import Collection, Mapping
from typing import Literal

import numpy as np

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.errors import AnysimError, CapabilityError
from anysim.math import pose as P
from anysim.task.scene import SceneView
from anysim_sensors.sight.eye import LeftOut, Shapes
from anysim_sensors.sight.identities import Identities

Source = Literal["geometry", "engine"]
TOLD = frozenset({"range", "depth", "instance_id", "class_id"})
"""Channels that follow from distances and entities, which is what engines say of rays."""


def refuse_engine(scene: SceneView, channels: Collection[str], leave_out: LeftOut, shapes: Shapes) -> None:
    """What rays of engines cannot do is refused.

    Raises:
        CapabilityError: the engine has no rays.
        AnysimError: something else is asked of it.
    """
    engine = scene.engine
    if Capability.RAYCAST not in engine.capabilities:
        raise CapabilityError(
            f"{engine.name} does not have '{Capability.RAYCAST}', which `source: engine` needs; leave `source` out, "
            f"and the shapes of the world are asked"
        )
    for name in channels:
        if name not in TOLD:
            raise AnysimError(f"rays of an engine tell distances and things, so no '{name}'; leave `source` out")
    if leave_out != "nothing":
        raise AnysimError("rays of an engine meet everything; say so with `leave_out: nothing`, and mount it outside")
    if shapes != "collision":
        raise AnysimError("rays of an engine meet what collides; leave `shapes` out")


def engine_rays(scene: SceneView, frames: Array, directions: Array, env_ids: Array) -> tuple[Array, Array]:
    """Distances (n, R) [m], inf where nothing is met, and segmentation ids, along directions in frames (n, 7)."""
    rows = np.broadcast_to(directions, (len(env_ids), *directions.shape[-2:]))
    origins = np.broadcast_to(frames[:, None, :3], rows.shape)
    hits = scene.engine.raycast(origins, P.rotate(frames[:, None, 3:], rows), env_ids)
    return hits.distance, np.maximum(hits.entity, 0)


def identified(named: Identities, measured: Array, entity: Array) -> Mapping[str, Array]:
    """The numbers of what is met, where it is measured."""
    entity = np.where(measured, entity, 0)
    return {"instance_id": named.instance[entity], "class_id": named.class_[entity]}
