"""A World with something added or removed: what live editing rebuilds engines with. The given World is not changed.

New entities come last, so that everything else keeps its index; after a removal all indices close up.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from pydantic import ValidationError

from anysim.compile.builder import WorldBuilder
from anysim.compile.dynamics import with_dynamics
from anysim.compile.object import add_object
from anysim.compile.robot import add_robot, placement
from anysim.compile.sensors import compile_camera
from anysim.conventions import GROUND, WORLD
from anysim.errors import Issues, NameLookupError, SpecError, SpecIssue, listing, suggest
from anysim.model.hash import split
from anysim.model.slots import members
from anysim.model.world import Channel, MeshShape, Quat, Robot, Slot, Vec3, World
from anysim_schemas.base import Spec
from anysim_schemas.cameras import CameraSpec
from anysim_schemas.objects import ObjectSpec
from anysim_schemas.robots import RobotSpec

S = TypeVar("S", bound=Spec)
_TURN = ("roll", "pitch", "yaw", "quaternion")
_PLACE = ("position", *_TURN)


def with_object(world: World, name: str, spec: Mapping[str, Any]) -> World:
    """With one more object: the fields of an `objects` entry, and `position` with `roll, pitch, yaw` or `quaternion`.

    Raises:
        SpecError: the name is taken, or a field is unknown or wrong.
        AssetError: its mesh or asset cannot be had.
    """
    path = f"objects.{name}"
    _free_name(world, name, path)
    fields = {key: value for key, value in spec.items() if key not in _PLACE}
    parsed = _parse(ObjectSpec, fields, path, extra=_PLACE)
    position, quaternion = _place({key: spec[key] for key in _PLACE if key in spec}, path)
    builder, issues = WorldBuilder(world), Issues(path)
    add_object(builder, name, parsed, issues, base=None, position=position, quaternion=quaternion)
    issues.raise_if_any()
    return builder.build()


def with_robot(world: World, name: str, robot: str, placement: Mapping[str, Any]) -> World:
    """With one more robot: `placement` has fields of a `robots` entry; `roll`, `pitch`, or a `quaternion` turn it too.

    Raises:
        SpecError: the name is taken, the robot unknown, or a field unknown or wrong.
    """
    path = f"robots.{name}"
    _free_name(world, name, path)
    builder, issues = WorldBuilder(world), Issues(path)
    tilted = any(key in placement for key in _TURN if key != "yaw")
    fields = {key: value for key, value in placement.items() if not (tilted and key in _TURN)}
    parsed = _parse(RobotSpec, {"robot": robot, **fields}, path, extra=_TURN)
    add_robot(builder, name, parsed, issues)
    issues.raise_if_any()
    if tilted:
        root, (_, turn) = (
            builder.entities[-1].body_start,
            _place({k: placement[k] for k in _TURN if k in placement}, path),
        )
        builder.bodies[root] = replace(builder.bodies[root], quaternion=turn)
    made = with_dynamics(builder.build(), {name: parsed}, (about := Issues("robots")))
    about.raise_if_any()
    return made


def with_camera(world: World, name: str, spec: Mapping[str, Any]) -> World:
    """With one more camera, after the present ones: the fields of a `cameras` entry.

    Raises:
        SpecError: the name is taken, a field is wrong, or what it looks at or rides on does not exist.
    """
    path = f"cameras.{name}"
    names = [camera.name for camera in world.cameras]
    if name in names:
        raise SpecError([SpecIssue("", path, f"there is a camera named '{name}' already (cameras: {listing(names)})")])
    issues = Issues(path)
    camera = compile_camera(world, name, _parse(CameraSpec, spec, path), issues)
    issues.raise_if_any()
    return world if camera is None else replace(world, cameras=(*world.cameras, camera))


def without_entity(world: World, name: str) -> World:
    """Without an entity, or all that a logical object or a category can be, and without what hangs on it.

    With it go its sites and drives, cameras that ride on it, contact sensors on it, and those that feel nothing but it.
    A camera that looks at it stays where it is.

    Raises:
        NameLookupError: there is no such entity.
    """
    names = [entity.name for entity in world.entities]
    if name not in names:
        every = [world.entities[e].name for slot in members(world, name) for e in slot.entities]
        if not every:
            raise NameLookupError(f"there is no entity '{name}'{suggest(name, names)} (entities: {listing(names)})")
        for one in every:
            world = without_entity(world, one)
        return world
    gone = world.entities[names.index(name)]
    bodies = _numbers(len(world.bodies), range(gone.body_start, gone.body_stop))
    joints = _numbers(len(world.joints), range(gone.joint_start, gone.joint_stop))
    sites = _numbers(len(world.sites), [i for i, s in enumerate(world.sites) if s.body not in bodies])
    drives = _numbers(len(world.actuators), [i for i, a in enumerate(world.actuators) if a.joint not in joints])
    geoms = tuple(replace(g, body=bodies[g.body]) for g in world.geoms if g.body in bodies)
    shown = {g.shape.mesh for g in geoms if isinstance(g.shape, MeshShape)}
    left = {e.name for e in world.entities if e.name != name} | {slot.name for slot in _slots(world, names.index(name))}
    shift_bodies = gone.body_stop - gone.body_start
    shift_joints = gone.joint_stop - gone.joint_start
    return replace(
        world,
        bodies=tuple(replace(b, parent=bodies[b.parent]) for i, b in enumerate(world.bodies) if i in bodies),
        joints=tuple(
            replace(j, body=bodies[j.body], mimic=j.mimic and j.mimic._replace(joint=joints[j.mimic.joint]))
            for i, j in enumerate(world.joints)
            if i in joints
        ),
        geoms=geoms,
        sites=tuple(replace(s, body=bodies[s.body]) for s in world.sites if s.body in bodies),
        actuators=tuple(
            replace(a, joint=joints[a.joint], shares=tuple((joints[j], ratio) for j, ratio in a.shares))
            for a in world.actuators
            if a.joint in joints
        ),
        cameras=tuple(
            replace(c, body=bodies[c.body], look_at=c.look_at if c.look_at in left else None)
            for c in world.cameras
            if c.body in bodies
        ),
        contact_sensors=_sensors(world, bodies),
        entities=tuple(
            replace(
                e,
                body_start=e.body_start - shift_bodies,
                body_stop=e.body_stop - shift_bodies,
                joint_start=e.joint_start - shift_joints,
                joint_stop=e.joint_stop - shift_joints,
            )
            if e.body_start > gone.body_start
            else e
            for e in world.entities
            if e.name != name
        ),
        robots=tuple(_robot(r, joints, sites, drives) for r in world.robots if r.name != name),
        meshes=tuple(mesh for mesh in world.meshes if mesh.name in shown),
        tendons=tuple(t.renumbered(lambda j: joints[j]) for t in world.tendons if t.joints[0] in joints),
        constraints=tuple(
            c.renumbered(lambda b: bodies[b])
            for c in world.constraints
            if c.body in bodies and (c.other == WORLD or c.other in bodies)
        ),
        spatial_tendons=tuple(
            t.renumbered(lambda b: bodies[b]) for t in world.spatial_tendons if set(t.bodies) <= {*bodies}
        ),
        excluded_pairs=frozenset(
            (bodies[a], bodies[b]) for a, b in world.excluded_pairs if a in bodies and b in bodies
        ),
        slots=_slots(world, names.index(name)),
        notes=tuple(note for note in world.notes if note[0] in {e.category for e in world.entities if e.name != name}),
    )


def _numbers(count: int, gone: Iterable[int]) -> dict[int, int]:
    """New indices of what stays; the world's own (-1) stays."""
    dropped = set(gone)
    kept = [i for i in range(count) if i not in dropped]
    return {WORLD: WORLD, **{old: new for new, old in enumerate(kept)}}


def _slots(world: World, gone: int) -> tuple[Slot, ...]:
    """The slots without an entity; one that has no other goes with it."""
    left = [replace(slot, entities=tuple(e - (e > gone) for e in slot.entities if e != gone)) for slot in world.slots]
    return tuple(slot for slot in left if slot.entities)


def _sensors(world: World, bodies: Mapping[int, int]) -> tuple[Any, ...]:
    kept = []
    for sensor in world.contact_sensors:
        own = tuple(bodies[b] for b in sensor.bodies if b in bodies)
        against = None if sensor.against is None else tuple(bodies[b] for b in sensor.against if b in bodies)
        if own and against != ():
            kept.append(replace(sensor, bodies=own, against=against))
    return tuple(kept)


def _robot(robot: Robot, joints: Mapping[int, int], sites: Mapping[int, int], drives: Mapping[int, int]) -> Robot:
    channels: dict[str, Channel] = {
        name: replace(c, joints=tuple(joints[j] for j in c.joints), actuators=tuple(drives[a] for a in c.actuators))
        for name, c in robot.channels.items()
    }
    return replace(robot, channels=channels, tools={name: sites[site] for name, site in robot.tools.items()})


def _free_name(world: World, name: str, path: str) -> None:
    taken = [GROUND, *dict.fromkeys([*world.logical_objects, *world.categories, *(e.name for e in world.entities)])]
    if name in taken:
        raise SpecError([SpecIssue("", path, f"the name '{name}' is taken (entities: {listing(taken)})")])
    if not (name.isascii() and name[:1].isalpha() and name.replace("_", "").isalnum()):
        raise SpecError([SpecIssue("", path, f"'{name}' is no name: a letter, then letters, digits and underscores")])


def _parse(model: type[S], data: Mapping[str, Any], path: str, extra: tuple[str, ...] = ()) -> S:
    known = [field.alias or name for name, field in model.model_fields.items()] + list(extra)
    unknown = [key for key in data if key not in known]
    if unknown:
        issues = [
            SpecIssue("", f"{path}.{key}", f"unknown key{suggest(key, known)} (keys: {listing(known, 20)})")
            for key in unknown
        ]
        raise SpecError(issues)
    try:
        return model.model_validate(dict(data))
    except ValidationError as error:
        raise SpecError(
            [SpecIssue("", ".".join([path, *map(str, e["loc"])]), e["msg"]) for e in error.errors()]
        ) from error


def _place(fields: Mapping[str, Any], path: str) -> tuple[Vec3, Quat]:
    """The pose that the placement fields of a live edit say; the origin where they say none."""
    wanted = {"position": 3, "quaternion": 4, "roll": 0, "pitch": 0, "yaw": 0}
    values: dict[str, Any] = {}
    issues: list[SpecIssue] = []
    import numpy as np

    for key, value in fields.items():
        try:
            values[key] = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            values[key] = np.array([np.nan])
        if values[key].shape != ((wanted[key],) if wanted[key] else ()) or not np.isfinite(values[key]).all():
            count = f"{wanted[key]} finite numbers" if wanted[key] else "a finite number"
            issues.append(SpecIssue("", f"{path}.{key}", f"expected {count}, got {value!r}"))
    if "quaternion" in values and {"roll", "pitch", "yaw"} & set(values):
        issues.append(SpecIssue("", f"{path}.quaternion", "give either a quaternion or roll, pitch and yaw"))
    if "quaternion" in values and not issues and not 0.99 < np.linalg.norm(values["quaternion"]) < 1.01:
        issues.append(SpecIssue("", f"{path}.quaternion", "expected a unit quaternion x, y, z, w"))
    if issues:
        raise SpecError(issues)
    position = values.get("position", np.zeros(3))
    if "quaternion" in values:
        q = values["quaternion"]
        return split(np.concatenate([position, q / np.linalg.norm(q)]))
    return placement(position, [float(values.get(key, 0.0)) for key in ("roll", "pitch", "yaw")])


def unseen(world: World) -> World:
    """Without cameras and contact sensors: an engine that cannot draw can still move.

    All that may ever be there is there at once: nothing of it needs an engine in which things come and go.
    """
    return replace(world, cameras=(), contact_sensors=(), slots=())
