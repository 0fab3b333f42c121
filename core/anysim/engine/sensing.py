"""Sensing of an engine: images, cameras, rays and contact points."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array
from anysim.engine import arguments
from anysim.engine.cameras import CameraView
from anysim.engine.capability import Capability
from anysim.engine.lifecycle import EngineLifecycle, EnvIds
from anysim.engine.state import ContactPoints, RayHits
from anysim.errors import EngineError


class EngineSensing(EngineLifecycle):
    """The part of `SimEngine` that draws and measures; see `anysim.engine.base.SimEngine`."""

    def render(
        self,
        camera_name: str = "default",
        width: int | None = None,
        height: int | None = None,
        env_ids: EnvIds = None,
        channels: Sequence[str] = ("rgb",),
        body_pose: ArrayLike | None = None,
    ) -> dict[str, Array]:
        """Images of one camera, by channel.

        `rgb` (E, H, W, 3) uint8; `depth` (E, H, W) float32 [m] along the optical axis, inf beyond the far plane;
        `segmentation` (E, H, W) int32 entity ids (`Index.segmentation_id`; 0 elsewhere).

        `default` is an overview of the world where no camera has that name.

        With `body_pose` (E, B, 7), as `State.body_pose` once gave them, bodies are drawn there, and cameras that ride
        on them; what is there, its colours, lights and lenses are those of now. The state is not touched.
        """
        with self._lock:
            self._require_world()
            for channel in channels:
                if channel not in ("rgb", "depth", "segmentation"):
                    raise EngineError(f"there is no channel '{channel}' (channels: rgb, depth, segmentation)")
                self._require(Capability(f"render: {channel}"))
            ids = self._ids(env_ids)
            view = self._seen_from(camera_name, ids, body_pose, width, height)
            if not self.overlays:
                return self._render(view, ids, tuple(channels))
            if body_pose is not None:
                raise EngineError(
                    "matter that families draw is where it is now, and cannot be seen with bodies as they once were; "
                    "take images while the episode runs (`record.film: live`)"
                )
            self._require(Capability.RENDER_DEPTH)
            images = self._render(view, ids, tuple(dict.fromkeys((*channels, "depth"))))
            for overlay in self.overlays:
                overlay(ids, view, images)
            return {channel: images[channel] for channel in channels}

    def camera_view(self, camera_name: str, env_ids: EnvIds = None, body_pose: ArrayLike | None = None) -> CameraView:
        """What `render` would draw from: world poses and lenses of a camera now, or with `body_pose` as there."""
        with self._lock:
            self._require_world()
            return self._seen_from(camera_name, self._ids(env_ids), body_pose)

    def _seen_from(
        self,
        camera_name: str,
        ids: Array,
        body_pose: ArrayLike | None,
        width: int | None = None,
        height: int | None = None,
    ) -> CameraView:
        poses = self.get_state().body_pose[ids] if body_pose is None else self._recorded(body_pose, ids)
        return self._records.rig.view(camera_name, self.index, poses, ids, width, height)

    def _recorded(self, body_pose: ArrayLike, ids: Array) -> Array:
        """Poses as they were given, to the bit: no quaternion is normalised, so that the same pixels come of them."""
        shape = (len(ids), len(self.world.bodies), 7)
        arguments.poses("body_pose", body_pose, shape)
        return arguments.rows("body_pose", body_pose, shape).copy()  # the view keeps it

    def camera_poses(self, camera_name: str, env_ids: EnvIds = None) -> Array:
        """World poses (E, 7) of a camera's optical frame now."""
        return self.camera_view(camera_name, env_ids).pose

    def set_camera_pose(self, camera_name: str, pose: ArrayLike, env_ids: EnvIds = None) -> None:
        """Place a camera per env: poses (E, 7) in the frame of its body, or of the world where it has none."""
        with self._lock:
            self._require_world()
            ids = self._ids(env_ids)
            self._records.rig.poses[ids, self.index.camera(camera_name)] = arguments.poses("pose", pose, (len(ids), 7))
            self._records.appearance[ids] += 1

    def camera_mounts(self, camera_name: str, env_ids: EnvIds = None) -> Array:
        """Poses (E, 7) of a camera's optical frame in the frame of its body, or of the world where it has none."""
        with self._lock:
            self._require_world()
            return self._records.rig.poses[self._ids(env_ids), self.index.camera(camera_name)]

    def camera_fov(self, camera_name: str, env_ids: EnvIds = None) -> Array:
        """Vertical fields of view (E,) [degrees] of a camera."""
        with self._lock:
            self._require_world()
            return self._records.rig.fov[self._ids(env_ids), self.index.camera(camera_name)]

    def set_camera_fov(self, camera_name: str, fov: ArrayLike, env_ids: EnvIds = None) -> None:
        """Change a camera's vertical field of view per env: (E,) [degrees], between 1 and 170."""
        with self._lock:
            self._require_world()
            ids = self._ids(env_ids)
            rows = arguments.rows("fov", fov, (len(ids),))
            if rows.size and not (rows.min() > 1 and rows.max() < 170):
                raise EngineError(
                    f"a field of view lies between 1 and 170 degrees, got {rows.min():g} to {rows.max():g}"
                )
            self._records.rig.fov[ids, self.index.camera(camera_name)] = rows
            self._records.appearance[ids] += 1

    @property
    def appearance_changes(self) -> Array:
        """(N,) how often what is seen in an env was changed, other than by the motion of its bodies."""
        with self._lock:
            self._require_world()
            return self._records.appearance.copy()

    def raycast(self, origins: ArrayLike, directions: ArrayLike, env_ids: EnvIds = None) -> RayHits:
        """First hits of rays (E, R, 3) [m], world frame, with collision geometry. Directions need not be unit."""
        with self._lock:
            self._require_world()
            self._require(Capability.RAYCAST)
            ids = self._ids(env_ids)
            start = arguments.rows("origins", origins, (len(ids), None, 3))
            along = arguments.rows("directions", directions, start.shape)
            length = np.linalg.norm(along, axis=-1, keepdims=True)
            if start.size and length.min() < 1e-12:
                raise EngineError("a ray needs a direction that is not zero")
            return self._raycast(start, along / length, ids)

    def contacts(self, env_ids: EnvIds = None) -> ContactPoints:
        """All contact points of envs in their current state."""
        with self._lock:
            self._require_world()
            self._require(Capability.CONTACT_POINTS)
            return self._contacts(self._ids(env_ids))
