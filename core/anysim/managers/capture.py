"""CaptureManager: the one place where images are taken in a run: of which cameras, when, how bright and how noisy.

An image is taken once in a control step, whoever asks for it; where nobody asks nothing is drawn.
"""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import SpecError, SpecIssue, listing, suggest
from anysim.managers.base import Manager
from anysim.model.world import World
from anysim.randomization.draw import draw_rows
from anysim_schemas.cameras import CameraSpec


class CaptureManager(Manager):
    """Keeps the clock of each env, the brightness and noise of each camera in it, and its latest images.

    Attributes:
        every: control steps from one recorded image to the next.
        observed: cameras whose images are observed, and the control steps from one to the next.
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
            elif "rgb" not in cameras[name].channels:
                text = f"the camera gives no colours; add rgb to world.cameras.{name}.channels"
                issues.append(SpecIssue("", path, text))
        if issues:
            raise SpecError(issues)
        control_dt = world.physics.control_dt
        self.every = interval(control_dt, self.spec.record.fps)
        self.observed = {
            name: 1 if image.fps is None else interval(control_dt, image.fps) for name, image in images.items()
        }

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        n = engine.num_envs
        self._ticks = np.zeros(n, dtype=np.int64)
        self._specs: dict[str, CameraSpec] = {
            name: spec for name, spec in self.spec.world.cameras.items() if spec.exposure != 1.0 or spec.noise != 0.0
        }
        self._exposure = {name: np.ones(n) for name in self._specs}
        self._noise = {name: np.zeros(n) for name in self._specs}
        self._latest: dict[str, Array] = {}
        self._taken: dict[str, Array] = {}
        self.image_shapes = {
            f"images/{name}": (camera.height, camera.width, 3)
            for name in self.observed
            for camera in [engine.world.cameras[engine.index.camera(name)]]
        }
        """The shape of each observed image."""

    def reset(self, env_ids: Array) -> None:
        self._ticks[env_ids] = 0
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

    def after_step(self, env_ids: Array | None) -> None:
        if env_ids is None:
            self._ticks += 1
        else:
            self._ticks[env_ids] += 1

    # ------------------------------------------------------------------ images

    def due(self, env_ids: Array) -> Array:
        """Those of these envs whose images are recorded at this control step."""
        return env_ids[self._ticks[env_ids] % self.every == 0]

    def observe(self, env_ids: Array) -> dict[str, Array]:
        """The observed images (n, H, W, 3) uint8 by `images/CAMERA`; between two a camera shows its latest."""
        found: dict[str, Array] = {}
        for camera, every in self.observed.items():
            self._room(camera)
            new = (self._ticks[env_ids] % every == 0) | (self._taken[camera][env_ids] < 0)
            self.image(camera, env_ids[new])
            found[f"images/{camera}"] = self._latest[camera][env_ids]
        return found

    def image(self, camera: str, env_ids: Array) -> Array:
        """Images (n, H, W, 3) uint8 of a camera at this control step, with its brightness and noise."""
        self._room(camera)
        latest, taken = self._latest[camera], self._taken[camera]
        missing = env_ids[taken[env_ids] != self._ticks[env_ids]]
        if len(missing):
            latest[missing] = self._shoot(camera, missing)
            taken[missing] = self._ticks[missing]
        return latest[env_ids]

    def _room(self, camera: str) -> None:
        if camera not in self._latest:
            found, n = self.engine.world.cameras[self.engine.index.camera(camera)], self.engine.num_envs
            self._latest[camera] = np.zeros((n, found.height, found.width, 3), dtype=np.uint8)
            self._taken[camera] = np.full(n, -1, dtype=np.int64)

    def _shoot(self, camera: str, env_ids: Array) -> Array:
        found = self.engine.world.cameras[self.engine.index.camera(camera)]
        if "rgb" not in found.channels:
            # a run that only looks its names up has cameras that give nothing
            return np.zeros((len(env_ids), found.height, found.width, 3), dtype=np.uint8)
        images = self.engine.render(camera, env_ids=env_ids)["rgb"]
        if camera not in self._specs:
            return images
        for row, env in enumerate(env_ids.tolist()):
            light = images[row] * self._exposure[camera][env]
            level = self._noise[camera][env]
            if level > 0:
                generator = self.streams.generator(env, f"capture/{camera}/pixels", int(self._ticks[env]))
                light = light + 255 * level * generator.standard_normal(light.shape, dtype=np.float32)
            images[row] = np.rint(np.clip(light, 0, 255))
        return images

    # ------------------------------------------------------------------ snapshots

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        data = {"ticks": self._ticks[env_ids]}
        for name in self._specs:
            data |= {f"exposure.{name}": self._exposure[name][env_ids], f"noise.{name}": self._noise[name][env_ids]}
        for camera, every in self.observed.items():
            if every > 1 and camera in self._latest:  # an image of an earlier moment cannot be taken again
                data |= {f"latest.{camera}": self._latest[camera][env_ids]}
                data |= {f"taken.{camera}": self._taken[camera][env_ids]}
        return data

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._ticks[env_ids] = data["ticks"]
        for name in self._specs:
            self._exposure[name][env_ids] = data[f"exposure.{name}"]
            self._noise[name][env_ids] = data[f"noise.{name}"]
        for taken in self._taken.values():
            taken[env_ids] = -1
        for camera in self.observed:
            if f"latest.{camera}" in data:
                self._room(camera)
                self._latest[camera][env_ids] = data[f"latest.{camera}"]
                self._taken[camera][env_ids] = data[f"taken.{camera}"]


def interval(control_dt: float, fps: float) -> int:
    """Every how many control steps an image is taken, so that there are about `fps` a second [Hz]."""
    return max(1, round(1.0 / (control_dt * fps)))
