"""Options of MuJoCo that mean nothing to another engine."""

import os
from typing import ClassVar, Literal

from pydantic import Field

from anysim.engine.options import EngineOptions


class MujocoOptions(EngineOptions):
    """Options of the engine `mujoco`, as in `engine: {name: mujoco, options: {threads: 4}}`."""

    shaping: ClassVar[tuple[str, ...]] = ("integrator", "solver", "iterations", "tolerance", "jacobian")

    threads: int = Field(default=0, ge=0, description="threads that step envs; 0: one per env, at most one per CPU")
    integrator: Literal["implicitfast", "implicit", "euler"] = Field(
        default="implicitfast", description="implicitfast keeps stiff drives stable; the drive law is defined with it"
    )
    solver: Literal["newton", "cg"] = Field(
        default="newton", description="cg is faster where hundreds of bodies touch each other"
    )
    iterations: int = Field(default=100, ge=1, description="most iterations of the constraint solver")
    tolerance: float = Field(default=1e-8, ge=0, description="improvement at which the constraint solver stops")
    jacobian: Literal["auto", "dense", "sparse"] = Field(default="auto", description="auto: sparse from 60 dofs on")
    memory_mb: int = Field(
        default=0, ge=0, description="memory for contacts per thread [MiB]; 0: MuJoCo's own estimate"
    )
    gl: Literal["auto", "egl", "osmesa"] = Field(
        default="auto", description="how images are drawn; auto: what MUJOCO_GL says, else EGL, else OSMesa"
    )
    shadows: bool = Field(default=False, description="cast shadows; several times slower without a GPU")
    antialiasing: int = Field(default=4, ge=0, le=16, description="samples per pixel; 0 is fastest")

    def thread_count(self, num_envs: int) -> int:
        """The threads to use for `num_envs` envs."""
        cpus = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        return self.threads or max(1, min(num_envs, cpus))
