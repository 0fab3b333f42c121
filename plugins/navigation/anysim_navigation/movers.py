"""Movers: what goes through a room by itself, as discs with the velocities that they have."""

from collections.abc import Sequence

import numpy as np

from anysim.conventions import Array
from anysim.geometry.bounds import EntityShape
from anysim.task.scene import SceneView

PARKED = 100.0
"""[m] how far off a mover is put that is not there."""


class Movers:
    """Entities that move by themselves. Their velocity is that which they have, not one that they were told.

    Attributes:
        bodies: all of theirs.
    """

    def __init__(self, scene: SceneView, names: Sequence[str]) -> None:
        world = scene.engine.world
        self._scene = scene
        entities = [world.entities[world.entity_numbers[name]] for name in names]
        self._numbers = np.array([world.entity_numbers[name] for name in names], dtype=np.int64)
        self._roots = np.array([e.root for e in entities], dtype=np.int64)
        self.bodies = {body for e in entities for body in range(e.body_start, e.body_stop)}
        upright = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        corners = [EntityShape(world, name).bounds(upright) for name in names]
        self._offset = np.array([0.5 * (low + high)[:2] for low, high in corners]).reshape(-1, 2)
        self._radius = np.array([0.5 * float((high - low)[:2].max()) for low, high in corners])

    def around(self, rows: Array, pose: Array) -> Array:
        """(n, M, 5) x, y, vx, vy and radius in frames x, y, yaw (n, 3); `rows` are those of the scene."""
        if not len(self._roots):
            return np.zeros((len(rows), 0, 5))
        envs = self._scene.env_ids[rows]
        state = self._scene.state
        place = state.body_pose[envs][:, self._roots, :2] + self._offset - pose[:, None, :2]
        speed = state.body_twist[envs][:, self._roots, :2]
        place[~self._scene.presence[envs][:, self._numbers]] += PARKED
        c, s = np.cos(pose[:, 2])[:, None], np.sin(pose[:, 2])[:, None]
        turned = [
            np.stack([c * v[..., 0] + s * v[..., 1], c * v[..., 1] - s * v[..., 0]], axis=-1) for v in (place, speed)
        ]
        radius = np.broadcast_to(self._radius, place.shape[:2])[..., None]
        return np.concatenate([*turned, radius], axis=-1)
