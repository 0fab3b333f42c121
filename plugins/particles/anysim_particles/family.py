"""Particle matter as a family: what fluid and grains have in common."""

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.engine.cameras import CameraView
from anysim.errors import SpecError, SpecIssue
from anysim.families.base import Family, FamilyPart, FamilySetting, FamilyState
from anysim.families.cosolver import CoSolver, MetBodies, about_origin
from anysim.math import pose as P
from anysim.model.world import Body, BodyKind
from anysim.randomization.draw import draw_rows
from anysim.threads import shared
from anysim_particles import skins
from anysim_particles.spec import MOST, MatterSpec
from anysim_schemas.base import Spec
from anysim_sensors.scene import SceneGeometry


class Particles(CoSolver):
    """P particles in each env; `x`, `v` are (N, P, 3), and the first `count` of an env's are there."""

    drawn = True
    label: ClassVar[str]
    looks: ClassVar[float] = 1.0
    """How much larger than its matter a particle is drawn."""
    meets_skins: ClassVar[bool] = False
    """Whether it meets the skins of other matter."""

    # ------------------------------------------------------------------ what kinds differ in

    @classmethod
    @abstractmethod
    def block(cls, spec: MatterSpec) -> Array:
        """(P, 3) [m] the particles of a full block about the middle of its bottom, before anything is drawn."""

    @classmethod
    @abstractmethod
    def radius(cls, spec: MatterSpec) -> float:
        """[m] of matter around a particle."""

    @abstractmethod
    def particle_mass(self, env_ids: Array) -> Array:
        """(n,) [kg] of a particle."""

    @abstractmethod
    def step_env(self, env: int, proxies: object, duration: float) -> None:
        """Move the particles of an env on, of which there are some."""

    @classmethod
    def members(cls, spec: MatterSpec) -> int:
        """How many particles in a row stay together."""
        return 1

    # ------------------------------------------------------------------ the World

    @classmethod
    def parts(cls, name: str, spec: Spec) -> Iterable[FamilyPart]:
        assert isinstance(spec, MatterSpec)
        count = len(cls.block(spec))
        if not 0 < count <= MOST:
            key = "box" if spec.box is not None else "cylinder"
            raise SpecError(
                [SpecIssue("", f".{key}", f"the block holds {count:,} particles; 1 to {MOST:,} are possible")]
            )
        body = Body("", BodyKind.STATIC)
        return [FamilyPart(name, ImportedModel(name, (body,), links={"": 0}), cls.label)]

    # ------------------------------------------------------------------ made

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        assert isinstance(setting.spec, MatterSpec)
        self.matter = setting.spec
        self._block = self.block(setting.spec)
        size, world = len(self._block), setting.engine.world
        self.x, self.v = self.remember("x", size, 3), self.remember("v", size, 3)
        self.count = self.remember("count", dtype=np.int64, bounds=(0, size))
        self.density = self.remember("density")
        self.scene = SceneGeometry(world)
        self._at = None if setting.spec.at is None else self.body(setting.spec.at, "at")
        slots = np.full(len(world.bodies) + 1, len(self.met), dtype=np.int32)
        slots[self.met] = np.arange(len(self.met))
        self._slot = slots[self.scene.geoms.body]
        floats = [not world.bodies[i].gravity_compensation and bool(world.loose[i]) for i in self.met]
        self._falls = np.array([*floats, False], dtype=bool)
        self._gravity = np.array(world.physics.gravity, dtype=float)
        self._skinned: Sequence[skins.Skinned] = ()

    def joined(self, families: Sequence[Family]) -> None:
        if self.meets_skins:
            self._skinned = [one for one in families if isinstance(one, skins.Skinned)]

    def drawn_value(self, key: str, env_ids: Array) -> Array:
        """A parameter as it is in the episodes of these envs."""
        path = f"world.families.{self.setting.name}.{key}"
        stream = f"family/{self.setting.name}/{key}"
        return draw_rows(getattr(self.matter, key), stream, self.setting.streams, env_ids, source=path)

    # ------------------------------------------------------------------ its life

    def fill(self, env_ids: Array) -> None:
        self.density[env_ids] = self.drawn_value("density", env_ids)
        share, yaw = self.drawn_value("fill", env_ids), self.drawn_value("yaw", env_ids)
        place = self.drawn_value("position", env_ids)
        members = self.members(self.matter)
        self.count[env_ids] = np.rint(share * (len(self._block) // members)).astype(np.int64) * members
        if self._at is None:
            place = place + self.setting.origin[env_ids]
        else:
            frame = self.engine.get_state().body_pose[env_ids, self._at]
            heading = P.yaw(frame[:, 3:])
            yaw = yaw + heading
            c, s = np.cos(heading), np.sin(heading)
            x, y = place[:, 0].copy(), place[:, 1].copy()
            place = frame[:, :3] + np.stack([c * x - s * y, s * x + c * y, place[:, 2]], axis=1)
        for row, env in enumerate(env_ids.tolist()):
            points = self.disordered(env)
            c, s = np.cos(yaw[row]), np.sin(yaw[row])
            turned = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
            self.x[env] = turned + place[row]
        self.v[env_ids] = 0.0

    @abstractmethod
    def disordered(self, env: int) -> Array:
        """The block (P, 3) as the episode of an env has it."""

    def generator(self, env: int, what: str) -> np.random.Generator:
        """Random numbers of an env's episode."""
        return self.setting.streams.generator(env, f"family/{self.setting.name}/{what}")

    def solve(self, env_ids: Array, bodies: MetBodies, duration: float) -> Array:
        from anysim_particles.kernels.contacts import Proxies

        n = len(env_ids)
        others = self._skinned
        tables = [skins.table([other.skin(env) for other in others]) for env in env_ids.tolist()]
        met, size = len(self.met), len(self.met) + (len(tables[0].points) if tables else 0)
        posed = self.scene.posed(bodies.body_pose, bodies.there)
        impulse = np.zeros((n, size + 1, 6))
        free = np.isfinite(bodies.mass) & (bodies.mass > 0)
        light = np.zeros((n, size + 1))
        light[:, :met][free] = 1.0 / bodies.mass[free]
        turns = np.zeros((n, size + 1, 3, 3))
        if free.any():
            turns[:, :met][free] = np.linalg.inv(bodies.inertia[free])
        com, twist = np.zeros((n, size + 1, 3)), np.zeros((n, size + 1, 6))
        com[:, :met], twist[:, :met] = bodies.com, bodies.twist
        for row, one_table in enumerate(tables):
            com[row, met:size], twist[row, met:size, :3] = one_table.points, one_table.velocities
            light[row, met:size] = 1.0 / one_table.mass
        slot = np.where(self._slot == met, np.int32(size), self._slot)
        falls = np.concatenate([self._falls[:met], np.zeros(size + 1 - met, dtype=bool)])
        # rows of their own: kernels are compiled for each layout
        friction = np.ascontiguousarray(bodies.friction[:, self.scene.geoms.number])

        def one(row: int) -> None:
            env = int(env_ids[row])
            if not self.count[env]:
                return
            proxies = Proxies(
                com[row],
                com[row].copy(),
                twist[row],
                twist[row].copy(),
                falls,
                light[row],
                turns[row],
                impulse[row],
                slot,
                posed.frame[row],
                posed.low[row],
                posed.high[row],
                posed.there[row],
                friction[row],
                tables[row].face + np.int32(met),
                tables[row].begin,
                tables[row].thick,
            )
            self.step_env(env, proxies, duration)

        shared(one, range(n))
        if others:
            self._splash(env_ids, others, tables, impulse[:, met:size, :3])
        return np.ascontiguousarray(impulse[:, :met])

    def _splash(
        self, env_ids: Array, others: Sequence[skins.Skinned], tables: Sequence[skins.SkinTable], impulse: Array
    ) -> None:
        """Tell families of other matter what their points (n, V, 3) [N s] got; it was not received from them."""
        for row, env in enumerate(env_ids.tolist()):
            got, points = impulse[row], tables[row].points
            self.received[env] -= about_origin(got, points)
            begun = 0
            for other, count in zip(others, tables[row].counts, strict=True):
                other.touch(env, got[begun : begun + count])
                begun += count

    def momentum(self, env_ids: Array) -> Array:
        mass, found = self.particle_mass(env_ids), np.zeros((len(env_ids), 6))
        for row, env in enumerate(env_ids.tolist()):
            found[row] = about_origin(self.v[env, : self.count[env]], self.x[env, : self.count[env]])
        return found * mass[:, None]

    # ------------------------------------------------------------------ what it looks like and means

    def there(self, env_ids: Array) -> Array:
        """(n, P) bool: the particles that are there."""
        return np.arange(self.x.shape[1]) < self.count[env_ids, None]

    def state(self, env_ids: Array) -> FamilyState:
        size = self.x.shape[1]
        ids = np.full(size, self.setting.entities[0] + 1, dtype=np.int32)
        radius = np.full(size, self.radius(self.matter))
        fields = {"there": self.there(env_ids)}
        return FamilyState(self.x[env_ids].copy(), self.v[env_ids].copy(), radius, ids, fields=fields)

    def fault(self, env_ids: Array) -> Array:
        return np.array([not np.isfinite(self.x[env]).all() for env in env_ids], dtype=bool)

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        count = int(self.count[env])
        x = self.x[env, :count]
        mass = float(self.particle_mass(np.array([env]))[0]) * count
        known: dict[str, object] = {"matter": self.label, "particles": count, "mass": mass}
        if count:
            known |= {"middle": x.mean(axis=0).tolist(), "low": x.min(axis=0).tolist(), "high": x.max(axis=0).tolist()}
        return {self.setting.name: known}

    def recorded(self, env_ids: Array) -> Mapping[str, Array]:
        """Momentum of the matter, its middle, and what it received: any difference of a particle shows in them."""
        there = self.there(env_ids)[..., None]
        middle = np.where(there, self.x[env_ids], 0.0).sum(axis=1) / np.maximum(self.count[env_ids], 1)[:, None]
        return {"middle": middle, "momentum": self.momentum(env_ids), "received": self.received[env_ids]}

    def draw(self, env_ids: Array, view: CameraView, images: Mapping[str, Array]) -> None:
        from anysim_particles.draw import draw_spheres

        for row, env in enumerate(env_ids.tolist()):
            draw_spheres(
                self.x[env, : self.count[env]],
                self.radius(self.matter) * self.looks,
                self.color,
                self.setting.entities[0] + 1,
                view,
                row,
                images,
            )
