"""Compilation of a validated spec: robots, objects, their nominal places, cameras, sensors, lights.

Fields that are drawn anew in each episode enter with their nominal value. All faults of a spec are reported at once,
each with its dotted key.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from anysim.assets.model import ImportNote
from anysim.compile.appearance import compile_lights, compile_scenery
from anysim.compile.builder import WorldBuilder
from anysim.compile.collisions import with_exclusions
from anysim.compile.dynamics import with_dynamics
from anysim.compile.families import add_families
from anysim.compile.plausibility import check_places
from anysim.compile.population import add_population, check_names
from anysim.compile.robot import add_robot
from anysim.compile.room import add_room
from anysim.compile.sensors import with_sensors
from anysim.compile.terrain import add_terrain
from anysim.compile.variants import instances
from anysim.conventions import GROUND
from anysim.errors import Issues
from anysim.model.world import Actuation, Physics, Slot, World
from anysim.placement.nominal import place_nominally
from anysim.placement.order import check_layout
from anysim.randomization.distributions import nominal
from anysim_schemas.bounds import DEFAULT_EXTENT
from anysim_schemas.engine import PhysicsSpec
from anysim_schemas.rooms import furniture_names
from anysim_schemas.run import RunSpec, WorldSpec


class CompiledWorld(NamedTuple):
    """A World, and for each entity what its importer repaired or left out."""

    world: World
    report: Mapping[str, tuple[ImportNote, ...]]


Base = Path | Mapping[str, Path] | None
"""What relative asset paths are relative to: one folder, or one for each object by name and for the ground."""


def compile_world(spec: RunSpec | WorldSpec, *, physics: PhysicsSpec | None = None, base: Base = None) -> World:
    """The World of a spec.

    Args:
        spec: of a run, or of a world alone.
        physics: time steps and gravity; those of the run where it is one, else the defaults.
        base: the folder that relative asset paths are relative to, or one for each object.

    Raises:
        SpecError: names that do not exist, cycles, values that do not fit; all of them, with dotted keys.
        AssetError: files that are missing or cannot be used, where the spec is otherwise right.
    """
    return compile_with_report(spec, physics=physics, base=base).world


def compile_with_report(
    spec: RunSpec | WorldSpec, *, physics: PhysicsSpec | None = None, base: Base = None
) -> CompiledWorld:
    """As `compile_world`, with the notes of the importers."""
    if isinstance(spec, RunSpec):
        issues, content, steps = Issues("world"), spec.world, physics or spec.physics
    else:
        issues, content, steps = Issues(), spec, physics or PhysicsSpec()
    builder = WorldBuilder(World(content.name, neutral_physics(steps), visual_error=content.visual_error))
    add_terrain(builder, content.terrain, issues.at("terrain"), _base(base, GROUND))
    add_room(builder, content, issues)
    notes: dict[str, tuple[ImportNote, ...]] = {}
    if content.source is not None:
        if content.source.notes is None:
            issues.add("source", "the file has not been read; load the world with `anysim.load` or `anysim.make`")
        notes["source"] = tuple(ImportNote(*note) for note in content.source.notes or ())
        builder.note("source", notes["source"])
    for name, robot in content.robots.items():
        notes[name] = tuple(add_robot(builder, name, robot, issues.at("robots", name)))
    check_names(content.objects, content.robots, issues.at("objects"))
    slots: list[Slot] = []
    for name, thing in content.objects.items():
        found, varying = add_population(builder, name, thing, issues.at("objects", name), base=_base(base, name))
        notes[name] = tuple(found)
        slots += varying
    add_families(builder, content.families or {}, issues.at("families"))
    fixtures = [] if content.room is None else furniture_names(content.room)
    logical = [one for name, thing in content.objects.items() for one in instances(name, thing)]
    order = check_layout(
        content.layout,
        list(content.objects),
        list(content.robots),
        issues.at("layout"),
        fixtures,
        instances=logical,
        regions=list(content.regions),
    )
    lights = compile_lights(content.lights, issues.at("lights"))
    scenery = compile_scenery(content.scenery, issues.at("scenery"))
    world = replace(builder.build(), slots=tuple(slots), lights=lights, scenery=scenery)
    missing = {*content.robots, *content.objects} - {entity.category for entity in world.entities}
    if missing:  # what looks at a thing that could not be made would only repeat its error
        issues.raise_if_any()
    world = with_dynamics(world, content.robots, issues.at("robots"))
    world = place_nominally(world, content.layout, order, issues.at("layout"), content.regions)
    check_places(world, issues)
    world = with_exclusions(world, content.collisions, issues.at("collisions"))
    world = with_sensors(world, content.cameras, content.contact_sensors, issues)
    issues.raise_if_any()
    return CompiledWorld(world, notes)


def _base(base: Base, name: str) -> Path | None:
    return base.get(name) if isinstance(base, Mapping) else base


def neutral_physics(spec: PhysicsSpec) -> Physics:
    """The physics part of a World."""
    return Physics(
        spec.dt,
        spec.control_dt,
        nominal(spec.gravity),
        spec.friction_cone,
        spec.impratio,
        Actuation(spec.actuation),
        spec.velocity_limits == "enforce",
        DEFAULT_EXTENT if spec.extent is None else spec.extent,
    )
