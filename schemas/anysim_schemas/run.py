"""The root of a file: everything about a run."""

from typing import Any, Self

from pydantic import Field, model_validator

from anysim_schemas.base import Integer, Name, NonNegative, Spec
from anysim_schemas.cameras import CameraSpec
from anysim_schemas.collect import CollectSpec
from anysim_schemas.collisions import CollisionsSpec
from anysim_schemas.contact_sensors import ContactSensorSpec
from anysim_schemas.engine import EngineSpec, PhysicsSpec
from anysim_schemas.errors import KeyFault
from anysim_schemas.families import FamilySpec
from anysim_schemas.layout import LayoutSourceSpec, PlacementSpec
from anysim_schemas.lights import LightSpec, ScenerySpec
from anysim_schemas.messages import listing
from anysim_schemas.objects import ObjectSpec
from anysim_schemas.record import RecordSpec
from anysim_schemas.regions import RegionSpec
from anysim_schemas.robots import RobotSpec
from anysim_schemas.rooms import RoomSpec
from anysim_schemas.scene import SceneSpec
from anysim_schemas.sensors import SensorSpec
from anysim_schemas.task import TaskSpec
from anysim_schemas.terrain import TerrainSpec


class WorldSpec(Spec):
    """What exists (robots, objects), where it goes (layout), and what looks at it (cameras, sensors, lights)."""

    name: Name = Field(default="world", description="the name of the world")
    source: SceneSpec | None = Field(
        default=None, description="a scene file of another program, whose bodies are objects of this world"
    )
    terrain: TerrainSpec = Field(default=TerrainSpec(), description="the ground")
    room: RoomSpec | None = Field(default=None, description="walls around the scene, and furniture")
    robots: dict[Name, RobotSpec] = Field(default_factory=dict, description="robots by name")
    objects: dict[Name, ObjectSpec] = Field(default_factory=dict, description="objects by name")
    layout: dict[Name, PlacementSpec] = Field(default_factory=dict, description="where each object goes at reset")
    layout_source: LayoutSourceSpec | None = Field(
        default=None, description="where proposals of objects' poses come from; none where not given"
    )
    regions: dict[Name, RegionSpec] = Field(
        default_factory=dict, description="named parts of the plane, for the layout"
    )
    cameras: dict[Name, CameraSpec] = Field(default_factory=dict, description="cameras by name")
    lights: dict[Name, LightSpec] = Field(default_factory=dict, description="lights by name")
    scenery: ScenerySpec = Field(default=ScenerySpec(), description="background, ambient light and shadows")
    contact_sensors: dict[Name, ContactSensorSpec] = Field(default_factory=dict, description="contact sensors by name")
    sensors: dict[Name, SensorSpec] | None = Field(
        default=None, description="sensors by name: what terms read through `sensor`, and what is recorded"
    )
    families: dict[Name, FamilySpec] | None = Field(
        default=None, description="matter and people by name, which a plugin makes and moves beside the engine"
    )
    collisions: CollisionsSpec = Field(default=CollisionsSpec(), description="what passes through what")
    visual_error: NonNegative | None = Field(
        default=None,
        description="[m] that 99 % of what meshes look like may be off; 0 keeps every triangle, 0.002 where not given",
    )

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        shared = sorted(set(self.robots) & set(self.objects))
        if shared:
            raise KeyFault(
                f"robots and objects share one name space; both have {', '.join(shared)}", "objects", shared[0]
            )
        if shared := sorted(set(self.families or ()) & {*self.robots, *self.objects}):
            raise KeyFault(f"there is already a robot or an object '{shared[0]}'", "families", shared[0])
        for kind in ("robots", "objects", "families"):
            if "terrain" in (getattr(self, kind) or ()):
                raise KeyFault("the name `terrain` is taken by the ground", kind, "terrain")
        return self


class RunSpec(Spec):
    """A world, an engine, and optionally a task and a record."""

    engine: EngineSpec = Field(default=EngineSpec(), description="the engine that runs the world")
    num_envs: Integer = Field(default=1, gt=0, description="number of parallel environments")
    level: Name | None = Field(default=None, description="which of the `levels` to run; the file as it is if not given")
    levels: dict[Name, dict[str, Any]] = Field(
        default_factory=dict,
        description="levels of difficulty: what each changes, as a file that extends this one would",
    )
    robot: str | None = Field(
        default=None,
        description="a robot of the catalogue in the place of the task's own; one of the `alternates`, or another that "
        "has the channels and tools which the task uses",
    )
    alternates: dict[Name, dict[str, Any]] = Field(
        default_factory=dict,
        description="other robots that the task is for, by their names in the catalogue: what each changes, as a file "
        "that extends this one would",
    )
    seed: Integer = Field(default=0, ge=0, lt=2**64, description="seed of everything that is drawn")
    physics: PhysicsSpec = Field(default=PhysicsSpec(), description="time steps and gravity")
    world: WorldSpec = Field(default=WorldSpec(), description="what exists, where it goes and what looks at it")
    task: TaskSpec | None = Field(default=None, description="what is observed, rewarded and counted as success")
    collect: CollectSpec | None = Field(
        default=None, description="commands of an episode that is collected; the task's expert where not given"
    )
    record: RecordSpec = Field(default=RecordSpec(), description="what is written, and by whom")

    @model_validator(mode="after")
    def _sensors_are_read(self) -> Self:
        sensors = self.world.sensors or {}
        for name, sensor in sensors.items():
            try:
                sensor.steps(self.physics.control_dt)
            except KeyFault as fault:
                raise KeyFault(str(fault), "world", "sensors", name, *fault.path) from None
        for name, channels in (self.record.channels or {}).items():
            if (camera := self.world.cameras.get(name)) is None:
                words = f"there is no camera '{name}' (cameras: {listing(list(self.world.cameras))})"
                raise KeyFault(words, "record", "channels", name)
            if lacking := sorted(set(channels) - set(camera.channels)):
                words = f"the camera gives no {' and no '.join(lacking)}; add it to world.cameras.{name}.channels"
                raise KeyFault(words, "record", "channels", name)
        for place, name in enumerate(self.record.sensors or ()):
            if name not in sensors:
                words = f"there is no sensor '{name}' (sensors: {listing(list(sensors))})"
                raise KeyFault(words, "record", "sensors", str(place))
        return self

    def without_curricula(self) -> Self:
        """The same for who learns nothing: values are drawn from their whole spread, and tiles of all levels."""
        task = None if self.task is None else self.task.model_copy(update={"curriculum": None})
        terrain = self.world.terrain
        if terrain.tiling.choose == "draw":
            return self.model_copy(update={"task": task})
        drawn = terrain.model_copy(
            update={"tiles": terrain.tiling.model_copy(update={"choose": "draw", "start": None})}
        )
        return self.model_copy(update={"task": task, "world": self.world.model_copy(update={"terrain": drawn})})
