"""CameraManager: view points and lenses are state of the world; who looks at an object is aimed when it is placed.

A camera that is fixed to the world belongs to its env's scene: it moves with the env's piece of ground.
"""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.managers.base import Manager
from anysim.managers.overrides import WORLD, Overridable, random_fields
from anysim.math import pose as P
from anysim.model.frames import find_frame
from anysim.model.slots import ABSENT, active_entity, single
from anysim.randomization.draw import draw_rows, is_random
from anysim_schemas.cameras import CameraSpec

_POSE = ("from_", "look_at_offset", "position", "roll_pitch_yaw")


class CameraManager(Manager):
    """Draws and aims, at every reset. The engine's contract holds and restores poses and fields of view."""

    name = "camera"

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        there = {camera.name for camera in engine.world.cameras}
        cameras = {name: spec for name, spec in self.spec.world.cameras.items() if name in there}
        self._aimed = {
            name: spec
            for name, spec in cameras.items()
            if isinstance(spec.look_at, str)
            or any(is_random(getattr(spec, field)) for field in _POSE)
            or (spec.mount is None and engine.world.tiles)
        }
        self._still = {name: s for name, s in cameras.items() if s.mount is None and name not in self._aimed}
        self._zoomed = {name: spec for name, spec in cameras.items() if is_random(spec.fov)}

    def overridable(self) -> list[Overridable]:
        cameras = self.spec.world.cameras
        keys = ("look_at_offset", "position", "roll_pitch_yaw", "fov")
        return [e for name in cameras for e in random_fields(f"{WORLD}cameras.{name}", cameras[name], keys)]

    def reset(self, env_ids: Array) -> None:
        moved = self._still if self.board.origin[env_ids].any() else {}  # they stand in their env's scene
        for name, spec in (self._aimed | moved).items():
            pose = self._mounted(name, spec, env_ids) if spec.mount is not None else self._looking(name, spec, env_ids)
            self.engine.set_camera_pose(name, pose, env_ids)
        for name, spec in self._zoomed.items():
            self.engine.set_camera_fov(name, self._drawn(name, "fov", spec.fov, env_ids), env_ids)

    def _looking(self, name: str, spec: CameraSpec, env_ids: Array) -> Array:
        """World poses (E, 7) of a camera that looks at a point or at an object."""
        origin = self.board.origin[env_ids]
        eyes = self._drawn(name, "from", spec.from_, env_ids) + origin
        if isinstance(spec.look_at, str):
            target = self._target(spec.look_at, env_ids)
        else:
            target = np.array(spec.look_at, dtype=float) + origin
        target = target + self._drawn(name, "look_at_offset", spec.look_at_offset, env_ids)
        return np.concatenate([eyes, P.look_at(eyes, target)], axis=1)

    def _target(self, name: str, env_ids: Array) -> Array:
        """Where an object is (E, 3); where it is absent, the place that it has nominally."""
        world, poses = self.engine.world, self.engine.get_state().body_pose
        slot = single(world, name)
        if len(slot.entities) == 1 and not world.slots:
            return poses[env_ids, world.entities[slot.entities[0]].root, :3]
        there = active_entity(slot, self.engine.presence[env_ids])
        entities = np.where(there == ABSENT, slot.entities[0], there)
        bodies = np.array([entity.root for entity in world.entities])[entities]
        nominal = world.initial_body_pose[bodies, :3]
        return np.where((there == ABSENT)[:, None], nominal, poses[env_ids, bodies, :3])

    def _mounted(self, name: str, spec: CameraSpec, env_ids: Array) -> Array:
        """Poses (E, 7) of a camera in the frame of the body that it rides on."""
        assert spec.mount is not None
        place = self._drawn(name, "position", spec.position, env_ids)
        turn = P.from_roll_pitch_yaw(self._drawn(name, "roll_pitch_yaw", spec.roll_pitch_yaw, env_ids))
        frame = find_frame(self.engine.world, spec.mount)
        link = np.broadcast_to(P.pose(frame.position, frame.quaternion), (len(env_ids), 7))
        return P.compose(link, np.concatenate([place, turn], axis=1))

    def _drawn(self, camera: str, field: str, value: Any, env_ids: Array) -> Array:
        source = f"world.cameras.{camera}.{field}"
        return draw_rows(value, f"camera/{camera}/{field}", self.streams, env_ids, source=source)
