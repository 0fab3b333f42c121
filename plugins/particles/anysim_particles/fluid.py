"""The family `fluid`: a liquid that keeps its density, carries and lifts what it meets, and takes any container."""

from typing import Any, ClassVar

from anysim.conventions import Array
from anysim.families.base import FamilySetting
from anysim_particles.blocks import lattice
from anysim_particles.family import Particles
from anysim_particles.spec import FluidSpec, MatterSpec


class Fluid(Particles):
    """A liquid of particles."""

    spec = FluidSpec
    label = "liquid"
    tint = (0.15, 0.42, 0.75)
    looks: ClassVar[float] = 1.25
    meets_skins: ClassVar[bool] = True

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        assert isinstance(setting.spec, FluidSpec)
        self.fluid = setting.spec
        self.smoothing, self.drag = self.remember("smoothing"), self.remember("drag")

    @classmethod
    def block(cls, spec: MatterSpec) -> Array:
        assert isinstance(spec, FluidSpec)
        return lattice(spec, spec.spacing)

    @classmethod
    def radius(cls, spec: MatterSpec) -> float:
        assert isinstance(spec, FluidSpec)
        return spec.spacing / 2

    def particle_mass(self, env_ids: Array) -> Array:
        return self.density[env_ids] * self.fluid.spacing**3

    def fill(self, env_ids: Array) -> None:
        super().fill(env_ids)
        self.smoothing[env_ids] = self.drawn_value("smoothing", env_ids)
        self.drag[env_ids] = self.drawn_value("drag", env_ids)

    def disordered(self, env: int) -> Array:
        return self._block + self.generator(env, "packing").uniform(-1e-3, 1e-3, self._block.shape) * self.fluid.spacing

    def step_env(self, env: int, proxies: Any, duration: float) -> None:
        from anysim_particles.kernels.fluid import fluid_step

        fluid, count = self.fluid, int(self.count[env])
        fluid_step(
            self.x[env],
            self.v[env],
            count,
            self.scene.geoms,
            self.scene.triangles,
            proxies,
            self.received[env],
            self._gravity,
            duration,
            fluid.substeps,
            fluid.iterations,
            fluid.spacing,
            float(self.density[env]) * fluid.spacing**3,
            float(self.smoothing[env]),
            float(self.drag[env]),
        )
