"""CameraManager: view points are state of the world; those that look at an object are aimed when it has been placed.

A camera that is fixed to the world belongs to its env's scene: it moves with the env's piece of ground.
"""

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.engine.base import SimEngine
from anysim.managers.base import Manager
from anysim.math import pose as P
from anysim.world.model import Slot
from anysim.world.slots import ABSENT, active_entity, single


class CameraManager(Manager):
    """Aims the cameras that look at an object, at every reset. The engine's contract holds and restores the poses."""

    name = "camera"

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        self._aimed = [
            (camera.name, np.array(camera.position), single(engine.world, camera.look_at))
            for camera in engine.world.cameras
            if camera.look_at is not None
        ]
        self._fixed = [
            (camera.name, np.array([*camera.position, *camera.quaternion]))
            for camera in engine.world.cameras
            if camera.body == WORLD and camera.look_at is None and engine.world.tiles
        ]

    def reset(self, env_ids: Array) -> None:
        origin = self.board.origin[env_ids]
        for name, pose in self._fixed:
            moved = np.tile(pose, (len(env_ids), 1))
            moved[:, :3] += origin
            self.engine.set_camera_pose(name, moved, env_ids)
        for name, eye, slot in self._aimed:
            target = self._target(slot, env_ids)
            eyes = eye + origin
            self.engine.set_camera_pose(name, np.concatenate([eyes, P.look_at(eyes, target)], axis=1), env_ids)

    def _target(self, slot: Slot, env_ids: Array) -> Array:
        """Where the object is (E, 3); where it is absent, the place that it has nominally."""
        world, poses = self.engine.world, self.engine.get_state().body_pose
        if len(slot.entities) == 1 and not world.slots:
            return poses[env_ids, world.entities[slot.entities[0]].root, :3]
        there = active_entity(slot, self.engine.presence[env_ids])
        entities = np.where(there == ABSENT, slot.entities[0], there)
        bodies = np.array([entity.root for entity in world.entities])[entities]
        nominal = world.initial_body_pose[bodies, :3]
        return np.where((there == ABSENT)[:, None], nominal, poses[env_ids, bodies, :3])
