"""Cameras: where they look from in an episode, and the one place where their images are taken in a run."""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.cameras import blank_images
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.errors import SpecError, SpecIssue, listing, suggest
from anysim.managers.base import WORLD, Manager, Overridable, random_fields
from anysim.managers.markers import paint
from anysim.math import pose as P
from anysim.model.frames import find_frame
from anysim.model.slots import ABSENT, active_entity, single
from anysim.model.world import Camera, World
from anysim.randomization.draw import draw_rows, is_random
from anysim_schemas.cameras import CameraSpec

_POSE = ("from_", "look_at_offset", "position", "roll_pitch_yaw")

_CALLED = {"rgb": "colours"}

_MOST_LIGHT = 1e6
"""Exposure and noise of a snapshot beyond this are nonsense."""


class CameraManager(Manager):
    """Draws view points and lenses, and aims, at every reset; the engine holds and restores them.

    A camera that looks at an object is aimed when the object is placed. One that is fixed to the world belongs to its
    env's scene: it moves with the env's piece of ground.
    """

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
        moved = self._still if self.episodes.origin[env_ids].any() else {}  # they stand in their env's scene
        for name, spec in (self._aimed | moved).items():
            pose = self._mounted(name, spec, env_ids) if spec.mount is not None else self._looking(name, spec, env_ids)
            self.engine.set_camera_pose(name, pose, env_ids)
        for name, spec in self._zoomed.items():
            self.engine.set_camera_fov(name, self._drawn(name, "fov", spec.fov, env_ids), env_ids)

    def _looking(self, name: str, spec: CameraSpec, env_ids: Array) -> Array:
        """World poses (E, 7) of a camera that looks at a point or at an object."""
        origin = self.episodes.origin[env_ids]
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


class CaptureManager(Manager):
    """Keeps the brightness and noise of each camera in each env, and its latest images.

    An image is taken once in a control step, however many ask for it; where none is asked for nothing is drawn.

    Attributes:
        every: control steps from one recorded image to the next.
        observed: cameras whose images are observed, and the control steps from one to the next.
        goals: by name the world poses (N, 7) of what the task aims at, kept by the task; they are marked where asked.
    """

    name = "capture"

    def build(self, world: World) -> None:
        issues: list[SpecIssue] = []
        cameras = self.spec.world.cameras
        images = {} if self.spec.task is None else self.spec.task.images
        for name in images:
            path = f"task.images.{name}"
            if name not in cameras:
                text = f"there is no camera '{name}'{suggest(name, list(cameras))} (cameras: {listing(cameras)})"
                issues.append(SpecIssue("", path, text))
            elif lacking := set(images[name].channels) - set(cameras[name].channels):
                text = (
                    f"the camera gives no {' and no '.join(_CALLED.get(c, c) for c in sorted(lacking))}; add "
                    f"{' and '.join(sorted(lacking))} to world.cameras.{name}.channels"
                )
                issues.append(SpecIssue("", path, text))
        if issues:
            raise SpecError(issues)
        self.goals: Mapping[str, Array] = {}
        self._marked = {name for name, image in images.items() if image.markers}
        control_dt = world.physics.control_dt
        self.every = interval(control_dt, self.spec.record.fps)
        self.observed = {
            name: 1 if image.fps is None else interval(control_dt, image.fps) for name, image in images.items()
        }
        self._channels = {name: image.channels for name, image in images.items()}

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        n = engine.num_envs
        self._specs: dict[str, CameraSpec] = {
            name: spec for name, spec in self.spec.world.cameras.items() if spec.exposure != 1.0 or spec.noise != 0.0
        }
        self._exposure = {name: np.ones(n) for name in self._specs}
        self._noise = {name: np.zeros(n) for name in self._specs}
        self._latest: dict[str, Array] = {}
        self._taken: dict[str, Array] = {}
        self.draw_seconds = 0.0
        """Wall time [s] of drawing so far, for tables of where time goes; nothing else depends on it."""
        self.image_shapes = {
            f"images/{_kept_as(name, channel)}": self._blank(name, channel, 0).shape[1:]
            for name in self.observed
            for channel in self._channels[name]
        }
        """The shape of each observed image."""

    def reset(self, env_ids: Array) -> None:
        for taken in self._taken.values():
            taken[env_ids] = -1
        for name, spec in self._specs.items():
            for field, kept in (("exposure", self._exposure), ("noise", self._noise)):
                kept[name][env_ids] = draw_rows(
                    getattr(spec, field),
                    f"capture/{name}/{field}",
                    self.streams,
                    env_ids,
                    source=f"world.cameras.{name}.{field}",
                )

    # ------------------------------------------------------------------ images

    def due(self, env_ids: Array) -> Array:
        """Those of these envs whose images are recorded at this control step."""
        return env_ids[self.episodes.elapsed[env_ids] % self.every == 0]

    def observe(self, env_ids: Array) -> dict[str, Array]:
        """The observed images; between two a camera shows its latest.

        `images/CAMERA` (n, H, W, 3) uint8, `images/CAMERA/depth` (n, H, W) float32 [m], at most the far plane's, and
        `images/CAMERA/segmentation` (n, H, W) int32 entity ids.
        """
        found: dict[str, Array] = {}
        for camera, every in self.observed.items():
            due = self.episodes.elapsed[env_ids] % every == 0
            for name, images in self._seen(camera, self._channels[camera], env_ids, due).items():
                marked = name == camera and camera in self._marked
                found[f"images/{name}"] = self.mark(images, camera, env_ids) if marked else images
        return found

    def image(self, camera: str, env_ids: Array) -> Array:
        """Images (n, H, W, 3) uint8 of a camera at this control step, with its brightness and noise."""
        return self._seen(camera, ("rgb",), env_ids, np.ones(len(env_ids), dtype=bool))[camera]

    def segmentation(self, camera: str, env_ids: Array) -> Array:
        """Segmentation images (n, H, W) int32 of a camera at this control step."""
        due = np.ones(len(env_ids), dtype=bool)
        return self._seen(camera, ("segmentation",), env_ids, due)[_kept_as(camera, "segmentation")]

    def _seen(self, camera: str, channels: Sequence[str], env_ids: Array, due: Array) -> dict[str, Array]:
        """The latest images of these envs, by `_kept_as`: of this control step where `due`, or where there is none."""
        now, names = self.episodes.elapsed[env_ids], [self._room(camera, channel) for channel in channels]
        taken = np.stack([self._taken[name][env_ids] for name in names])
        missing = ((taken < 0) | (due & (taken != now))).any(axis=0)
        if missing.any():
            drawn = self._shoot(camera, env_ids[missing], now[missing], channels)
            for name, channel in zip(names, channels, strict=True):
                self._latest[name][env_ids[missing]] = drawn[channel]
                self._taken[name][env_ids[missing]] = now[missing]
        return {name: self._latest[name][env_ids] for name in names}

    def picture(self, camera: str, env_ids: Array) -> Array:
        """Images (n, H, W, 3) uint8 as they are recorded: with the goals marked, unless the spec says otherwise."""
        images = self.image(camera, env_ids)
        return self.mark(images, camera, env_ids) if self._recorded_with_marks(camera) else images

    def mark(self, images: Array, camera: str, env_ids: Array, body_pose: Array | None = None) -> Array:
        """A copy of images with the goals marked; `body_pose` (n, B, 7) is where bodies were, if that was earlier."""
        return paint(images, self.goals, self.engine, camera, env_ids, body_pose)

    def _recorded_with_marks(self, camera: str) -> bool:
        """What a policy sees is recorded as it sees it; other cameras look on for people."""
        return camera in self._marked if camera in self.observed else self.spec.record.markers

    def image_then(self, camera: str, env: int, tick: int, body_pose: Array) -> Array:
        """The image (H, W, 3) uint8 of a camera at an earlier control step of an env's present episode.

        It is the one that `picture` gave or would have given then, if nothing that is seen was changed since the reset
        but the poses of the bodies: `body_pose` (B, 7), as the state had them.
        """
        ids, poses = np.array([env]), body_pose[None]
        image = self._shoot(camera, ids, np.array([tick]), ("rgb",), poses)["rgb"]
        return (self.mark(image, camera, ids, poses) if self._recorded_with_marks(camera) else image)[0]

    def _room(self, camera: str, channel: str) -> str:
        """Where a camera's images of a channel are kept: as `_kept_as` names it."""
        name = _kept_as(camera, channel)
        if name not in self._latest:
            self._latest[name] = self._blank(camera, channel, self.engine.num_envs)
            self._taken[name] = np.full(self.engine.num_envs, -1, dtype=np.int64)
        return name

    def _blank(self, camera: str, channel: str, rows: int) -> Array:
        """Images of nothing, of a camera's size; what a camera gives in a run that only looks its names up."""
        found = self._camera(camera)
        return blank_images((rows, found.height, found.width), [channel])[channel]

    def _camera(self, name: str) -> Camera:
        return self.engine.world.cameras[self.engine.index.camera(name)]

    def _shoot(
        self, camera: str, env_ids: Array, ticks: Array, channels: Sequence[str], body_pose: Array | None = None
    ) -> dict[str, Array]:
        lens = self._camera(camera)
        if not set(channels) <= set(lens.channels):
            return {channel: self._blank(camera, channel, len(env_ids)) for channel in channels}
        began = time.perf_counter()
        found = self.engine.render(camera, env_ids=env_ids, channels=channels, body_pose=body_pose)
        self.draw_seconds += time.perf_counter() - began
        if "depth" in found:  # finite, for policies and snapshots
            np.minimum(found["depth"], np.float32(lens.far), out=found["depth"])
        if "rgb" in found:
            self._expose(camera, env_ids, ticks, found["rgb"])
        return found

    def _expose(self, camera: str, env_ids: Array, ticks: Array, images: Array) -> None:
        """Give images the brightness and the noise that the camera has in these envs."""
        if camera not in self._specs:
            return
        for row, env in enumerate(env_ids.tolist()):
            light = images[row] * self._exposure[camera][env]
            level = self._noise[camera][env]
            if level > 0:
                generator = self.streams.generator(env, f"capture/{camera}/pixels", int(ticks[row]))
                light = light + 255 * level * generator.standard_normal(light.shape, dtype=np.float32)
            images[row] = np.rint(np.clip(light, 0, 255))

    # ------------------------------------------------------------------ snapshots

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        data: dict[str, Array] = {}
        for name in self._specs:
            data |= {f"exposure.{name}": self._exposure[name][env_ids], f"noise.{name}": self._noise[name][env_ids]}
        for camera, channel in self._lasting():  # an image of an earlier moment cannot be taken again
            name = _kept_as(camera, channel)
            if name in self._latest:
                data |= {f"latest.{name}": self._latest[name][env_ids], f"taken.{name}": self._taken[name][env_ids]}
        return data

    def _lasting(self) -> list[tuple[str, str]]:
        """The cameras and channels of observed images that show more than one control step."""
        return [(camera, c) for camera, every in self.observed.items() if every > 1 for c in self._channels[camera]]

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        for name in self._specs:
            refuse_range(f"exposure.{name}", data[f"exposure.{name}"], 0.0, _MOST_LIGHT)
            refuse_range(f"noise.{name}", data[f"noise.{name}"], 0.0, _MOST_LIGHT)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        for name in self._specs:
            self._exposure[name][env_ids] = data[f"exposure.{name}"]
            self._noise[name][env_ids] = data[f"noise.{name}"]
        for taken in self._taken.values():
            taken[env_ids] = -1
        for camera, channel in self._lasting():
            if f"latest.{_kept_as(camera, channel)}" in data:
                name = self._room(camera, channel)
                self._latest[name][env_ids], self._taken[name][env_ids] = data[f"latest.{name}"], data[f"taken.{name}"]


def _kept_as(camera: str, channel: str) -> str:
    """What the images of a camera's channel are called: `CAMERA` in colours, `CAMERA/depth`, `CAMERA/segmentation`."""
    return camera if channel == "rgb" else f"{camera}/{channel}"


def interval(control_dt: float, fps: float) -> int:
    """Every how many control steps an image is taken, so that there are about `fps` a second [Hz]."""
    return max(1, round(1.0 / (control_dt * fps)))
