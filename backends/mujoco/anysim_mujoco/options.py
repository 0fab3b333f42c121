"""Options of MuJoCo that mean nothing to another engine."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from anysim.engine.options import EngineOptions
from anysim.threads import usable_cores

SAMPLES = 4
"""Of each pixel, by default, where a graphics card draws."""


class MujocoOptions(EngineOptions):
    """Options of the engine `mujoco`, as in `engine: {name: mujoco, options: {threads: 4}}`."""

    shaping: ClassVar[tuple[str, ...]] = (
        *("integrator", "solver", "iterations", "tolerance", "jacobian", "ls_iterations", "noslip_iterations"),
        *("constraints", "density", "viscosity", "wind"),
    )

    threads: int = Field(default=0, ge=0, description="threads that step envs; 0: one per env, at most one per CPU")
    integrator: Literal["implicitfast", "implicit", "euler", "rk4"] = Field(
        default="implicitfast", description="implicitfast keeps stiff drives stable; the drive law is defined with it"
    )
    constraints: Literal["stiff", "mujoco"] = Field(
        default="stiff",
        description="of limits, ties, dry friction of which a model says nothing; mujoco: as soft as MuJoCo has them",
    )
    solver: Literal["newton", "cg", "pgs"] = Field(
        default="newton", description="cg is faster where hundreds of bodies touch each other"
    )
    iterations: int = Field(default=100, ge=1, description="most iterations of the constraint solver")
    tolerance: float = Field(default=1e-8, ge=0, description="improvement at which the constraint solver stops")
    ls_iterations: int = Field(default=50, ge=1, description="most iterations of the solver's line search")
    noslip_iterations: int = Field(default=0, ge=0, description="iterations after the solver's own against slipping")
    jacobian: Literal["auto", "dense", "sparse"] = Field(default="auto", description="auto: sparse from 60 dofs on")
    density: float = Field(default=0, ge=0, description="of a fluid that all moves in [kg/m^3]; water has 1000")
    viscosity: float = Field(default=0, ge=0, description="of that fluid [Pa s]")
    wind: tuple[float, float, float] = Field(default=(0.0, 0.0, 0.0), description="the fluid's velocity [m/s]")
    memory_mb: int = Field(
        default=0, ge=0, description="memory for contacts per thread [MiB]; 0: an estimate from the number of bodies"
    )
    gl: Literal["auto", "egl", "osmesa"] = Field(
        default="auto", description="how images are drawn; auto: what MUJOCO_GL says, else EGL, else OSMesa"
    )
    shadows: bool = Field(default=False, description="cast shadows; several times slower without a GPU")
    antialiasing: Literal["auto"] | Annotated[int, Field(ge=0, le=16)] = Field(
        default="auto",
        description=f"samples per pixel; auto: {SAMPLES} on a graphics card, 0 without one, where they cost 2.4 times",
    )

    def thread_count(self, num_envs: int) -> int:
        """The threads to use for `num_envs` envs."""
        return self.threads or max(1, min(num_envs, usable_cores()))

    def samples(self, in_software: bool) -> int:
        """The samples per pixel to draw with."""
        if self.antialiasing == "auto":
            return 0 if in_software else SAMPLES
        return self.antialiasing
