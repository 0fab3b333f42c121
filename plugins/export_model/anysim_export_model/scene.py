"""The trees of bodies that are written, with local names, each with its place, and the world around them."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from anysim import registry
from anysim.api import compile_world, load
from anysim.assets.load import import_asset, split_body
from anysim.assets.model import ActuatorHint, ImportedModel
from anysim.conventions import IDENTITY_QUATERNION, WORLD
from anysim.errors import AnysimError, suggest
from anysim.model.world import ORIGIN, BodyKind, Entity, Geom, HeightFieldShape, MeshShape, Quat, Site, Vec3, World

NO_CHANNELS: Mapping[str, tuple[str, ...]] = MappingProxyType({})


class Piece(NamedTuple):
    """One tree with its place in the world; `channels` are the joints of a robot by the channel's name.

    `there` tells whether it is there at first: an object may have several assets, of which one is seen at a time.
    """

    name: str
    model: ImportedModel
    root: BodyKind
    position: Vec3 = ORIGIN
    quaternion: Quat = IDENTITY_QUATERNION
    channels: Mapping[str, tuple[str, ...]] = NO_CHANNELS
    there: bool = True


class Scene(NamedTuple):
    """The trees of a world; `world` is None where a file alone was read.

    `apart` are pairs of bodies of different trees that never collide, by piece and local body; -1 is the world.
    """

    name: str
    pieces: tuple[Piece, ...]
    world: World | None = None
    apart: tuple[tuple[tuple[int, int], tuple[int, int]], ...] = ()

    @property
    def fixed_geoms(self) -> tuple[Geom, ...]:
        """The geoms of the world itself."""
        return () if self.world is None else tuple(geom for geom in self.world.geoms if geom.body == WORLD)

    @property
    def fixed_sites(self) -> tuple[Site, ...]:
        """The frames of the world itself."""
        return () if self.world is None else tuple(site for site in self.world.sites if site.body == WORLD)


def scene_of(what: str, overrides: tuple[str, ...] = ()) -> Scene:
    """A robot of the catalogue, a YAML file of a robot, a world or a task, an installed task, or a model file.

    Raises:
        AnysimError: there is none of that; see `import_asset`, `load` and `compile_world`.
    """
    path = Path(split_body(what)[0])
    endings = {".urdf", ".xml", ".mjcf", *(f".{name}" for name in registry.names("importers"))}
    if path.suffix.lower() in endings or re.match(r"(example-robot-data|robot_descriptions|procedural):", what):
        return scene_of_model(import_asset(what, base=Path.cwd()))
    if what in registry.names("robots") or _is_robot(path):
        name = path.resolve() if _is_robot(path) else what
        world = {"name": path.stem, "terrain": "none", "robots": {"robot": {"robot": str(name)}}}
        return scene_of_world(compile_world(load({"world": world}, overrides=list(overrides))))
    known = [*registry.names("robots"), *registry.names("tasks")]
    if not path.is_file() and what not in known:
        assets = registry.names("assets")
        hint = f"; the asset of that name is 'procedural:{what}'" if what in assets else suggest(what, known)
        raise AnysimError(
            f"there is no robot, task or file '{what}'{hint}; give a name of `anysim list robots` or "
            f"`anysim list tasks`, the YAML file of a world, or a model file ({', '.join(sorted(endings))})"
        )
    return scene_of_world(compile_world(load(path if path.is_file() else what, overrides=list(overrides))))


def _is_robot(path: Path) -> bool:
    """Whether a YAML file is the entry of a robot and not a world: it has a source and channels of its own."""
    if path.suffix.lower() not in (".yaml", ".yml") or not path.is_file():
        return False
    text = path.read_bytes()[: 1 << 20]
    return all(re.search(rb"^%s:" % key, text, re.MULTILINE) for key in (b"source", b"channels", b"license"))


def scene_of_model(model: ImportedModel) -> Scene:
    """A model alone, as a file has it."""
    return Scene(model.name, (Piece(model.name, model, model.bodies[0].kind),))


def scene_of_world(world: World) -> Scene:
    """The trees of a World."""
    pieces: list[Piece] = []
    place: dict[int, tuple[int, int]] = {}
    for number, entity in enumerate(world.entities):
        roots = [b for b in range(entity.body_start, entity.body_stop) if world.bodies[b].parent == WORLD]
        for start, stop in zip(roots, [*roots[1:], entity.body_stop], strict=True):
            place |= {body: (len(pieces), body - start) for body in range(start, stop)}
            pieces.append(_piece(world, entity, start, stop, bool(world.initial_presence[number])))
    apart = [
        (place.get(low, (-1, WORLD)), place.get(high, (-1, WORLD)))
        for low, high in sorted(world.excluded_pairs)
        if place.get(low, (-1, 0))[0] != place.get(high, (-1, 0))[0]
    ]
    return Scene(world.name, tuple(pieces), world, tuple(apart))


def _piece(world: World, entity: Entity, start: int, stop: int, there: bool) -> Piece:
    """A tree of an entity's bodies [start, stop)."""
    local = lambda name: name.removeprefix(f"{entity.name}.")  # noqa: E731
    joints = [j for j, joint in enumerate(world.joints) if start <= joint.body < stop]
    index = {joint: i for i, joint in enumerate(joints)}
    geoms = tuple(
        replace(geom, name=local(geom.name), body=geom.body - start)
        for geom in world.geoms
        if start <= geom.body < stop
    )
    meshes = {geom.shape.mesh for geom in geoms if isinstance(geom.shape, MeshShape)}
    fields = {geom.shape.heightfield for geom in geoms if isinstance(geom.shape, HeightFieldShape)}
    model = ImportedModel(
        name=entity.name,
        bodies=tuple(
            replace(body, name=local(body.name), parent=WORLD if body.parent == WORLD else body.parent - start)
            for body in world.bodies[start:stop]
        ),
        joints=tuple(
            replace(
                joint,
                name=local(joint.name),
                body=joint.body - start,
                mimic=None if joint.mimic is None else joint.mimic._replace(joint=index[joint.mimic.joint]),
            )
            for joint in (world.joints[j] for j in joints)
        ),
        geoms=geoms,
        sites=tuple(
            replace(site, name=local(site.name), body=site.body - start)
            for site in world.sites
            if start <= site.body < stop
        ),
        meshes=tuple(mesh for mesh in world.meshes if mesh.name in meshes),
        heightfields=tuple(field for field in world.heightfields if field.name in fields),
        actuator_hints=tuple(
            ActuatorHint(index[a.joint], a.mode, a.kp, a.kd, a.effort_limit)
            for a in world.actuators
            if a.joint in index
        ),
        excluded_pairs=frozenset(
            (low - start, high - start)
            for low, high in world.excluded_pairs
            if start <= low < stop and start <= high < stop
        ),
    )
    channels = {
        name: tuple(local(world.joints[j].name) for j in channel.joints)
        for robot in world.robots
        if robot.name == entity.name
        for name, channel in robot.channels.items()
    }
    root = world.bodies[start]
    name = entity.name if start == entity.body_start else f"{entity.name}_{start - entity.body_start}"
    return Piece(name, model, root.kind, root.position, root.quaternion, channels, there)
