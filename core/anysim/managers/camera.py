"""CameraManager: view points are state of the world; those that look at an object are aimed when it has been placed."""

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.managers.base import Manager
from anysim.math import pose as P


class CameraManager(Manager):
    """Aims the cameras that look at an object, at every reset. The engine's contract holds and restores the poses."""

    name = "camera"

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        self._aimed = [
            (camera.name, np.array(camera.position), engine.index.frame(camera.look_at).body)
            for camera in engine.world.cameras
            if camera.look_at is not None
        ]

    def reset(self, env_ids: Array) -> None:
        for name, eye, body in self._aimed:
            target = self.engine.get_state().body_pose[env_ids, body, :3]
            eyes = np.broadcast_to(eye, target.shape)
            self.engine.set_camera_pose(name, np.concatenate([eyes, P.look_at(eyes, target)], axis=1), env_ids)
