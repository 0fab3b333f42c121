"""The depth camera: images that the engine draws, or from rays, which are the same on every engine."""

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim_legged_gym.build import DEPTH
from anysim_legged_gym.layout import Layout
from anysim_legged_gym.spec import DepthSpec
from anysim_sensors.camera import RayCamera
from anysim_sensors.scene import SceneGeometry


class DepthCamera:
    """Depth images of all envs, as of the last update; those of an env that was reset since are of its new state.

    Attributes:
        images: (N, H, W) float32 [m] along the optical axis, between the planes.
    """

    def __init__(self, engine: SimEngine, layout: Layout, spec: DepthSpec) -> None:
        self._engine, self._spec = engine, spec
        width, height = spec.resolution
        self._images = np.full((engine.num_envs, height, width), spec.far_plane, dtype=np.float32)
        self._old = np.ones(engine.num_envs, dtype=bool)
        self._rays: RayCamera | None = None
        if spec.source == "rays":
            self._rays = RayCamera(width, height, spec.vertical_fov, 0.01, spec.far_plane)
            self._scene = SceneGeometry(engine.world)
            camera = engine.world.cameras[engine.index.camera(DEPTH)]
            self._seen = self._scene.without([camera.body])

    @property
    def images(self) -> Array:
        old = np.flatnonzero(self._old)
        if len(old):
            self.update(old)
        return self._images

    def update(self, ids: Array) -> None:
        """Look from where the cameras of these envs are now."""
        spec = self._spec
        if self._rays is None:
            found = self._engine.render(DEPTH, env_ids=ids, channels=("depth",))["depth"]
        else:
            posed = self._scene.posed(self._engine.get_state().body_pose[ids])
            found = self._rays.images(self._scene, posed, self._engine.camera_poses(DEPTH, ids), seen=self._seen).depth
        self._images = self._images.copy()  # what was handed out stays as it is
        self._images[ids] = np.clip(found, spec.near_plane, spec.far_plane)
        self._old[ids] = False

    def forget(self, ids: Array) -> None:
        """Have the images of these envs made anew when they are next asked for."""
        self._old[ids] = True
