"""The families `sand` and `rice`: dry grains with friction, round ones and long ones."""

from math import ceil, pi
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.families.base import FamilySetting
from anysim.math import pose as P
from anysim_particles.blocks import lattice, rows, scattered
from anysim_particles.family import Particles
from anysim_particles.spec import GrainSpec, MatterSpec, RiceSpec, SandSpec

ROOM = 1.25
"""Width of the room that a grain has at the reset, in widths of the grain."""


class Grains(Particles):
    """Grains of equal balls."""

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        assert isinstance(setting.spec, GrainSpec)
        self.grains = setting.spec
        self.friction = self.remember("friction")
        self.ball, self.apart = self.radius(setting.spec), 0.0
        self.volume = 4 / 3 * pi * self.ball**3

    def particle_mass(self, env_ids: Array) -> Array:
        return self.density[env_ids] * self.volume

    def fill(self, env_ids: Array) -> None:
        super().fill(env_ids)
        self.friction[env_ids] = self.drawn_value("friction", env_ids)

    def step_env(self, env: int, proxies: Any, duration: float) -> None:
        from anysim_particles.kernels.grains import grain_step

        grains, count = self.grains, int(self.count[env])
        grain_step(
            self.x[env],
            self.v[env],
            count,
            self.members(grains),
            self.scene.geoms,
            self.scene.triangles,
            proxies,
            self.received[env],
            self._gravity,
            duration,
            grains.substeps,
            grains.iterations,
            self.ball,
            float(self.particle_mass(np.array([env]))[0]),
            self.apart,
            float(self.friction[env]),
            grains.settling,
        )


class Sand(Grains):
    """Round grains."""

    spec = SandSpec
    label = "sand"
    tint = (0.78, 0.62, 0.38)

    @classmethod
    def block(cls, spec: MatterSpec) -> Array:
        assert isinstance(spec, SandSpec)
        return lattice(spec, 2 * ROOM * spec.radius)

    @classmethod
    def radius(cls, spec: MatterSpec) -> float:
        assert isinstance(spec, SandSpec)
        return spec.radius

    def disordered(self, env: int) -> Array:
        return scattered(self.grains, self.ball, len(self._block), self.generator(env, "packing"))


class Rice(Grains):
    """Long grains: balls in a rigid row, with the mass of a capsule of the grain's length and width."""

    spec = RiceSpec
    label = "rice"
    tint = (0.93, 0.9, 0.8)

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        assert isinstance(setting.spec, RiceSpec)
        rice, beads = setting.spec, self.members(setting.spec)
        straight = rice.length - rice.width
        self.apart = straight / (beads - 1)
        self.volume = pi * self.ball**2 * (straight + 4 / 3 * self.ball) / beads

    @classmethod
    def members(cls, spec: MatterSpec) -> int:
        assert isinstance(spec, RiceSpec)
        return 1 + max(2, ceil((spec.length - spec.width) / (0.6 * spec.width) - 1e-9))

    @classmethod
    def radius(cls, spec: MatterSpec) -> float:
        assert isinstance(spec, RiceSpec)
        return spec.width / 2

    @classmethod
    def _grains(cls, spec: RiceSpec) -> tuple[Array, Array]:
        return rows(spec, spec.length + (ROOM - 1.0) * spec.width, ROOM * spec.width)

    @classmethod
    def block(cls, spec: MatterSpec) -> Array:
        assert isinstance(spec, RiceSpec)
        middles, ways = cls._grains(spec)
        return cls._beads(spec, middles, ways)

    @classmethod
    def _beads(cls, spec: RiceSpec, middles: Array, ways: Array) -> Array:
        along = np.linspace(-0.5, 0.5, cls.members(spec)) * (spec.length - spec.width)
        return (middles[:, None] + along[:, None] * ways[:, None]).reshape(-1, 3)

    def disordered(self, env: int) -> Array:
        assert isinstance(self.matter, RiceSpec)
        middles, ways = self._grains(self.matter)
        numbers = self.generator(env, "packing")
        middles = middles + numbers.uniform(-0.7, 0.7, middles.shape) * (ROOM - 1.0) * self.ball
        ways = ways + numbers.uniform(-0.1, 0.1, ways.shape)
        return self._beads(self.matter, middles, ways / P.norm(ways)[:, None])
