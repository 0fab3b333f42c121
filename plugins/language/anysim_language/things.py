"""Semantics of things: the noun, colour, material, shape, size and parts of every object and robot of a World."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.geometry.bounds import EntityShape
from anysim.model.affordance_lookup import affordances_of
from anysim.model.shapes import Box, Capsule, Cylinder, Shape, Sphere
from anysim.model.world import Entity, EntityKind, World
from anysim_language.beside import robot_words, thing_words
from anysim_language.colours import bytes_of, colour_name, is_clear
from anysim_language.vocabulary import ThingWords, VocabularySpec

MAIN = 6
"""Of ten parts of what is seen of a thing, how many make its colour."""


@dataclass(frozen=True)
class Thing:
    """One logical object that is there, or a robot.

    Attributes:
        name: its logical name, the same through resets, engines and whatever asset it is made of.
        entity: the number of the entity that it is in this episode.
        robot: whether it is a robot.
        words: its noun with its plural, and more.
        colour: the name of most of its surface; empty where it has several, or a texture.
        colour_clear: whether all of it has that colour, far from any other name.
        paint: red, green, blue in [0, 1] of each shape that is seen; empty where a texture is.
        material: an adjective; empty where nothing is known.
        shape: such as `cube`; `object` for what is of several pieces.
        size: its extent along its own axes [mm], at its joints' initial positions.
        parts: local names of its links and affordances.
        affordances: what is taken hold of, as (local name, kind).
        count: how many bodies it is, more than one for an instancer.
        fixed: whether it cannot move.
    """

    name: str
    entity: int
    robot: bool
    words: ThingWords
    colour: str
    colour_clear: bool
    paint: tuple[tuple[float, float, float], ...]
    material: str
    shape: str
    size: tuple[int, int, int]
    parts: tuple[str, ...]
    affordances: tuple[tuple[str, str], ...]
    count: int
    fixed: bool


def things_of(
    engine: SimEngine, words: VocabularySpec, env: int = 0, folder: Callable[[str], Path | None] = lambda category: None
) -> tuple[Thing, ...]:
    """The logical objects that are there in an env, in the World's order, with what was drawn of their looks.

    `folder` gives what paths of the assets of a category are relative to.
    """
    world, present = engine.world, engine.presence[env]
    looks = {
        name: engine.get_parameters(f"geom.{name}", np.array([env]))[0] for name in ("color", "texture", "material")
    }
    found: list[Thing] = []
    for slot in world.logical_objects.values():
        for number in slot.entities:
            if present[number]:
                found.append(_thing(world, slot.name, number, looks, words, folder(slot.category)))
    return tuple(found)


def _thing(
    world: World, name: str, number: int, looks: Mapping[str, Array], words: VocabularySpec, folder: Path | None
) -> Thing:
    entity = world.entities[number]
    robot = entity.kind is EntityKind.ROBOT
    own = [g for body in range(entity.body_start, entity.body_stop) for g in world.body_geoms[body]]
    shown = [g for g in own if world.geoms[g].visible and looks["color"][g][3] > 0.0]
    shape, size = ("object", (0, 0, 0)) if robot else _form(world, entity)
    colour, clear = ("", False) if robot else _colour(world, shown, looks)
    material = {int(looks["material"][g]) for g in shown}
    preset = world.materials[material.pop()].name.partition("-")[0] if len(material) == 1 and min(material) >= 0 else ""
    local = [b.name.removeprefix(f"{entity.name}.") for b in world.bodies[entity.body_start + 1 : entity.body_stop]]
    declared = affordances_of(world, number)
    kind = _robot_words(world, name, words) if robot else _object_words(entity, shape, words, folder)
    return Thing(
        name=name,
        entity=number,
        robot=robot,
        words=kind,
        colour=colour or kind.colour or "",
        colour_clear=clear,
        paint=()
        if robot or any(looks["texture"][g] >= 0 for g in shown)
        else tuple(_rgb(looks["color"][g]) for g in shown),
        material=words.materials.get(preset, "") or kind.material or "",
        shape=shape,
        size=size,
        parts=tuple(local),
        affordances=tuple((one.name, str(one.kind)) for one in declared),
        count=entity.body_stop - entity.body_start if entity.family == "rigid_instancer" else 1,
        fixed=all(world.bodies[b].kind == "static" for b in range(entity.body_start, entity.body_stop)),
    )


def _rgb(color: Array) -> tuple[float, float, float]:
    return float(color[0]), float(color[1]), float(color[2])


def _object_words(entity: Entity, shape: str, words: VocabularySpec, folder: Path | None) -> ThingWords:
    """By label, by the label's last part, by source, as beside its asset, by shape, and at last the label itself."""
    label = entity.label or entity.category or entity.name
    last = label.rpartition("_")[2]
    for key in (label, last, entity.source):
        if key in words.things:
            return words.things[key]
    if beside := thing_words(entity.source, folder):
        return beside
    if shape != "object" and f"shape:{shape}" in words.things:
        return words.things[f"shape:{shape}"]
    readable = label.replace("_", " ").strip()
    return ThingWords(noun=readable) if readable else words.things["shape:object"]


def _robot_words(world: World, name: str, words: VocabularySpec) -> ThingWords:
    model = next((robot.model for robot in world.robots if robot.name == name), name)
    known = words.robots.get(model.rpartition(":")[2]) or robot_words(model)
    return known or ThingWords(
        noun=f"{model.rpartition(':')[2].rpartition('/')[2].partition('.')[0]} robot".replace("_", " ")
    )


def _form(world: World, entity: Entity) -> tuple[str, tuple[int, int, int]]:
    """The name of its shape, and its size [mm] along its own axes."""
    whole = EntityShape(world, entity.name)
    low, high = whole.bounds(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
    x, y, z = (int(float(e) * 1000.0 + 0.5) for e in high - low)
    single = whole.shapes[0].shape if len(whole.shapes) == 1 else None
    return _shape_name(single, sorted((x, y, z))), (x, y, z)


def _shape_name(shape: Shape | None, size: list[int]) -> str:
    """Of the shape and its sorted edges [mm]."""
    match shape:
        case Sphere():
            return "ball"
        case Capsule():
            return "rod"
        case Cylinder(radius, half_length):
            if half_length * 4 <= radius:
                return "disc"
            return "rod" if half_length >= radius * 4 else "cylinder"
        case Box():
            short, middle, long = size
            if long * 20 <= short * 21:
                return "cube"
            if short * 4 <= middle:
                return "slab"
            return "bar" if long * 2 >= middle * 3 and middle * 4 <= short * 5 else "box"
        case _:
            return "object"


def _colour(world: World, shown: list[int], looks: Mapping[str, Array]) -> tuple[str, bool]:
    """The name that most of what is seen has, and whether all of it clearly has that."""
    areas: dict[str, int] = {}
    clear = True
    for g in shown:
        if looks["texture"][g] >= 0:
            return "", False
        value = bytes_of(looks["color"][g])
        areas[colour_name(value)] = areas.get(colour_name(value), 0) + _area(world, g)
        clear = clear and is_clear(value)
    if not areas:
        return "", False
    name = max(sorted(areas), key=lambda one: areas[one])
    return (name, clear and len(areas) == 1) if areas[name] * 10 >= sum(areas.values()) * MAIN else ("", False)


def _area(world: World, geom: int) -> int:
    """Of the box around a geom, in whole mm²; 1 at least."""
    match world.geoms[geom].shape:
        case Box((x, y, z)):
            half = (x, y, z)
        case Sphere(r):
            half = (r, r, r)
        case Capsule(r, h):
            half = (r, r, h + r)
        case Cylinder(r, h):
            half = (r, r, h)
        case shape:
            mesh = next((m for m in world.meshes if m.name == getattr(shape, "mesh", "")), None)
            extent = np.ptp(mesh.vertices, axis=0) / 2 if mesh is not None else np.zeros(3)
            half = tuple(float(e) for e in extent)
    x, y, z = (int(e * 2000.0 + 0.5) for e in half)
    return max(2 * (x * y + y * z + z * x), 1)
