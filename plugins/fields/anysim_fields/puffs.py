"""Puffs of smoke and flame: what fire and flow have in common."""

from collections.abc import Callable, Mapping

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.engine.cameras import CameraView
from anysim.families.base import Family, FamilyState
from anysim.math import pose as P
from anysim_fields.spec import SourceSpec

ONE_PUFF = 1_000_000_000
NO_RGB, NO_IDS = np.zeros((0, 0, 3), dtype=np.uint8), np.zeros((0, 0), dtype=np.int32)


class Puffs:
    """K puffs in each env, in the memory of a family: the newest replace the oldest.

    Attributes:
        x, v: (N, K, 3) [m], [m/s].
        size: (N, K) [m], the standard deviation of each.
        mass: (N, K) [kg] of what is seen in each.
        age: (N, K) [s], below 0 of those that are not there.
    """

    def __init__(self, family: Family, spec: SourceSpec) -> None:
        self._family, self.setting, self._life = family, family.setting, spec.lifetime
        self.count, count = spec.puffs, spec.puffs
        remember = family.remember
        self.x, self.v, self._gust = (remember(key, count, 3) for key in ("x", "v", "gust"))
        self.size, self.mass, self.age = (remember(key, count) for key in ("size", "mass", "age"))
        self._next = remember("next", 1, dtype=np.int64, bounds=(0, count - 1))
        self._due = remember("due", 1, dtype=np.int64, bounds=(0, ONE_PUFF))
        self._luck = remember("luck", 2, dtype=np.int64)
        self._at = WORLD if spec.at is None else family.body(spec.at, "at")

    @property
    def id(self) -> int:
        """The segmentation id."""
        return self.setting.entities[0] + 1

    @property
    def rate(self) -> float:
        """[1/s] of new ones."""
        return self.count / self._life

    def reset(self, env_ids: Array) -> None:
        """No puffs yet, and new luck."""
        self.age[env_ids] = -1.0
        stream = f"family/{self.setting.name}/puffs"
        for env in env_ids.tolist():
            self._luck[env, 0] = self.setting.streams.generator(env, stream).integers(1 << 62)

    def source(self, env_ids: Array, position: Array) -> tuple[Array, Array, Array]:
        """Where the source is (n, 3) [m], how it is turned (n, 4), and whether it is there (n,)."""
        if self._at == WORLD:
            turn = np.tile([0.0, 0.0, 0.0, 1.0], (len(env_ids), 1))
            return self.setting.origin[env_ids] + position, turn, np.ones(len(env_ids), dtype=bool)
        engine = self.setting.engine
        pose = engine.get_state().body_pose[env_ids, self._at]
        there = engine.presence[env_ids, engine.world.body_entity[self._at]]
        return pose[:, :3] + P.rotate(pose[:, 3:], position), pose[:, 3:], there

    def advance(
        self,
        env: int,
        duration: float,
        *,
        source: Array,
        axis: Array,
        wind: Array,
        heat: float,
        speed: float,
        radius: float,
        turbulence: float,
        diffusion: float,
        settling: float,
        emission: float,
        emits: bool,
    ) -> None:
        """Move those of an env on; `emission` is in kg/s, all else as the kernel has it."""
        from anysim_fields.kernels.puffs import advance

        self.age[env, self.age[env] > self._life] = -1.0
        advance(
            self.x[env],
            self.v[env],
            self._gust[env],
            self.size[env],
            self.mass[env],
            self.age[env],
            self._next[env],
            self._due[env],
            self._luck[env],
            source,
            axis,
            wind,
            heat,
            speed,
            radius,
            turbulence,
            diffusion,
            settling,
            float(self.setting.origin[env, 2]),
            emission / self.rate,
            self.rate if emits else 0.0,
            duration,
        )

    def there(self, env_ids: Array) -> Array:
        """(n, K) bool."""
        return self.age[env_ids] >= 0.0

    def fade(self, env: int) -> Array:
        """(K,) the share of each that is seen: 1, and less in the last quarter of its life."""
        left = np.clip(4.0 * (1.0 - self.age[env] / self._life), 0.0, 1.0)
        return np.where(self.age[env] >= 0.0, left, 0.0)

    def state(self, env_ids: Array, radius: float, fields: Mapping[str, Array]) -> FamilyState:
        """Puffs as points."""
        own = {"there": self.there(env_ids), "size": self.size[env_ids], "mass": self.mass[env_ids]}
        ids = np.full(self.count, self.id, dtype=np.int32)
        return FamilyState(
            self.x[env_ids].copy(), self.v[env_ids].copy(), np.full(self.count, radius), ids, fields={**own, **fields}
        )

    def middle(self, env_ids: Array) -> Array:
        """(n, 3) [m] the middle of those that are there."""
        there = self.there(env_ids)[..., None]
        return np.where(there, self.x[env_ids], 0.0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)

    def fault(self, env_ids: Array) -> Array:
        """(n,) bool: envs in which some are nowhere."""
        return np.array([not np.isfinite(self.x[env]).all() for env in env_ids], dtype=bool)

    def draw(
        self, env_ids: Array, view: CameraView, images: Mapping[str, Array], looks: Callable[[int], tuple[Array, Array]]
    ) -> None:
        """Draw them; `looks(env)` gives their extinction (K,) [m^2] and colour (K, 3), 0 to 1."""
        from anysim_fields.kernels.haze import haze

        for row, env in enumerate(env_ids.tolist()):
            amount, color = looks(env)
            local = P.rotate_inverse(view.pose[row, 3:], self.x[env] - view.pose[row, :3])
            seen = np.flatnonzero((amount > 0.0) & (local[:, 2] > view.near))
            order = seen[np.argsort(local[seen, 2], kind="stable")]
            size = (view.height, view.width)
            focal = float(view.height / (2.0 * np.tan(np.radians(view.fov[row]) / 2.0)))
            haze(
                np.ascontiguousarray(local),
                self.size[env],
                amount,
                255.0 * color,
                order,
                focal,
                float(view.near),
                self.id,
                np.ones(size),
                np.zeros(size),
                np.zeros((*size, 3)),
                images["depth"][row],
                images["rgb"][row] if "rgb" in images else NO_RGB,
                images["segmentation"][row] if "segmentation" in images else NO_IDS,
            )
