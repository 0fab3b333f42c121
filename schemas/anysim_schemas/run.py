"""The root of a file: everything about a run."""

from typing import Annotated, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from anysim_schemas.base import Name, Spec
from anysim_schemas.cameras import CameraSpec
from anysim_schemas.engine import EngineSpec, PhysicsSpec
from anysim_schemas.layout import PlacementSpec
from anysim_schemas.objects import ContactSensorSpec, LightSpec, ObjectSpec, TerrainSpec
from anysim_schemas.record import RecordSpec
from anysim_schemas.robots import RobotSpec
from anysim_schemas.task import TaskSpec


class WorldSpec(Spec):
    """What exists (robots, objects), where it goes (layout), and what looks at it (cameras, sensors, lights)."""

    name: Name = "world"
    terrain: TerrainSpec = TerrainSpec()
    robots: dict[Name, RobotSpec] = Field(default_factory=dict)
    objects: dict[Name, ObjectSpec] = Field(default_factory=dict)
    layout: dict[Name, PlacementSpec] = Field(default_factory=dict)
    cameras: dict[Name, CameraSpec] = Field(default_factory=dict)
    lights: dict[Name, LightSpec] = Field(default_factory=dict)
    contact_sensors: dict[Name, ContactSensorSpec] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        shared = sorted(set(self.robots) & set(self.objects))
        if shared:
            raise ValueError(f"robots and objects share one name space; both have {', '.join(shared)}")
        if "terrain" in self.robots or "terrain" in self.objects:
            raise ValueError("the name `terrain` is taken by the ground")
        return self


class RunSpec(Spec):
    """A world, an engine, and optionally a task and a record."""

    engine: EngineSpec = EngineSpec()
    num_envs: Annotated[int, Field(gt=0, description="parallel environments")] = 1
    seed: Annotated[int, Field(ge=0)] = 0
    physics: PhysicsSpec = PhysicsSpec()
    world: WorldSpec = WorldSpec()
    task: TaskSpec | None = None
    record: RecordSpec = RecordSpec()

    @field_validator("engine", mode="before")
    @classmethod
    def _engine_shorthand(cls, data: object, _: ValidationInfo) -> object:
        return {"name": data} if isinstance(data, str) else data
