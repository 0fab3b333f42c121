"""Which engine runs the world, how, and with which time steps."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, Strict, model_validator

from anysim_schemas.base import Positive, Spec
from anysim_schemas.bounds import EXTENT, TIME_STEP
from anysim_schemas.errors import KeyFault
from anysim_schemas.plugin import PluginSlot
from anysim_schemas.values import Vec3Value

MAX_SUBSTEPS = 1_000_000


class EngineSpec(Spec):
    """An installed engine by name, with the options that only it understands. A bare string is the name."""

    kept_under_text: ClassVar[tuple[str, ...]] = ("shards", "shard_timeout")
    """These are of any engine: `--engine NAME` changes the engine and leaves them; options go with their engine."""

    name: Annotated[str, Field(description="an installed engine, as in `anysim list engines`")] = "mujoco"
    options: Annotated[dict[str, Any], PluginSlot("engine", "name")] = Field(
        default_factory=dict, description="options owned by the engine"
    )
    shards: Annotated[int, Field(ge=1)] | Literal["auto"] = Field(
        default=1,
        description="worker processes that share the envs, at most one for each; 1: none; auto: one for each core, "
        "but none for an engine that uses all cores by itself. Results do not depend on it",
    )
    shard_timeout: Positive = Field(
        default=300.0,
        description="longest time a worker may take for one control step before it is replaced and its envs are "
        "faulted [s]",
    )

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The name of the engine."""
        return {"name": text}


class PhysicsSpec(Spec):
    """Time steps and gravity. `control_dt` must be a whole multiple of `dt`."""

    dt: Annotated[float, Strict(), Field(ge=TIME_STEP.low, le=TIME_STEP.high)] = Field(
        default=0.002, description="physics time step [s]"
    )
    control_dt: Positive = Field(default=0.02, description="time between two actions [s]")
    gravity: Vec3Value = Field(default=(0.0, 0.0, -9.81), description="gravity [m/s^2], world axes, z up")
    friction_cone: Literal["elliptic", "pyramidal"] = Field(
        default="elliptic", description="shape of the friction cone where the engine offers a choice"
    )
    impratio: Positive = Field(
        default=1.0,
        description="ratio of frictional to normal contact impedance; above 1 reduces creep of grasped objects",
    )

    extent: Annotated[float, Strict(), Field(ge=EXTENT.low, le=EXTENT.high)] | None = Field(
        default=None,
        description="a body farther than this from the origin along an axis has left the world: its env is faulted "
        "[m]; 10,000 where not given",
    )
    actuation: Literal["implicit_pd", "explicit_pd", "native"] = Field(
        default="implicit_pd",
        description="implicit_pd: the drive law with its damping taken implicitly, the same on every engine; "
        "explicit_pd: the plain law of the state at the beginning of a step, for low gains; "
        "native: the engine's own drives, faster, their error declared by each engine",
    )
    velocity_limits: Literal["ignore", "enforce"] = Field(
        default="ignore",
        description="enforce: a drive asks for no more than its joint's velocity limit; ignore: planners alone heed it",
    )

    @model_validator(mode="after")
    def _limits_by_the_law(self) -> "PhysicsSpec":
        if self.velocity_limits == "enforce" and self.actuation == "native":
            raise KeyFault(
                "velocity_limits: enforce is part of the drive law, which actuation: native leaves to the engine; "
                "choose actuation: implicit_pd or explicit_pd",
                "velocity_limits",
            )
        return self

    @model_validator(mode="after")
    def _whole_substeps(self) -> "PhysicsSpec":
        ratio = self.control_dt / self.dt
        if not 1 - 1e-6 <= ratio <= MAX_SUBSTEPS or abs(ratio - round(ratio)) > 1e-6:
            raise KeyFault(
                f"control_dt ({self.control_dt:g} s) must be a whole multiple of dt ({self.dt:g} s), "
                f"but their ratio is {ratio:g}",
                "control_dt",
            )
        return self

    @property
    def substeps(self) -> int:
        """Physics steps per control step."""
        return round(self.control_dt / self.dt)
