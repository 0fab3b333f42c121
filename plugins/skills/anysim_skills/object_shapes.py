"""Sizes of an object, whatever it is in each env."""

import numpy as np

from anysim.conventions import Array
from anysim.geometry.bounds import shape_bounds
from anysim.task.scene import ObjectView, SceneView

_UPRIGHT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class ObjectShapes:
    """Bounds of an object, which may be another entity in each env."""

    def __init__(self, scene: SceneView, thing: ObjectView) -> None:
        self._scene, self._thing = scene, thing
        self._shapes = [scene.entity_shape(entity.name) for entity in thing.entities]
        corners = [shape.bounds(_UPRIGHT) for shape in self._shapes]
        self._low, self._high = (np.array([pair[i] for pair in corners]) for i in range(2))

    def _which(self, ids: Array) -> Array:
        """(n,) which of the entities that it can be it is in these envs."""
        if len(self._shapes) == 1:
            return np.zeros(len(ids), dtype=np.int64)
        return np.argmax(self._scene.presence[ids][:, self._thing.slot.entities], axis=1)

    def size(self, ids: Array) -> Array:
        """(n, 3) [m] along its own axes."""
        which = self._which(ids)
        return self._high[which] - self._low[which]

    def size_at(self, ids: Array, point: Array) -> Array:
        """(n, 3) [m] along its own axes, of those of its parts alone that are at a point (3,) of its own frame.

        The whole object's where no part is there: the handle of a hook, not the hook.
        """
        sizes = np.array([self._part_at(number, point) for number in range(len(self._shapes))])
        return sizes[self._which(ids)]

    def _part_at(self, number: int, point: Array) -> Array:
        """(3,) the size of the parts of an entity that are at a point (3,)."""
        meshes = {mesh.name: mesh for mesh in self._scene.engine.world.meshes}
        boxes = [np.array(shape_bounds(placed.shape, placed.pose, meshes)) for placed in self._shapes[number].shapes]
        own = [box for box in boxes if ((box[0] <= point) & (point <= box[1])).all()]
        if not own:
            return self._high[number] - self._low[number]
        return np.max([box[1] for box in own], axis=0) - np.min([box[0] for box in own], axis=0)

    def box(self, ids: Array) -> tuple[Array, Array]:
        """Its lowest and highest corners (n, 3) [m] in its own frame."""
        which = self._which(ids)
        return self._low[which], self._high[which]

    def radius(self, ids: Array) -> Array:
        """(n,) [m] how far it reaches from its origin along its own x or y."""
        which = self._which(ids)
        return np.maximum(np.abs(self._low[which]), np.abs(self._high[which]))[:, :2].max(axis=1)

    def below(self, ids: Array, poses: Array) -> Array:
        """(n,) [m] how far it reaches below its origin at world poses (n, 7)."""
        lowest, which = np.empty(len(ids)), self._which(ids)
        for number, shape in enumerate(self._shapes):
            own = which == number
            if own.any():
                lowest[own] = shape.bounds(poses[own])[0][..., 2]
        return poses[:, 2] - lowest
