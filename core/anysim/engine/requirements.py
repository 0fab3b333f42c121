"""Capabilities that a world needs of an engine, each with the name that causes it, and drives that can be followed."""

from collections import Counter
from collections.abc import Iterator, Mapping
from math import isfinite

import numpy as np

from anysim.compile.appearance import DEFAULT_LIGHTS
from anysim.conventions import WORLD, Array
from anysim.engine.capability import Capability as C, Need
from anysim.errors import EngineError
from anysim.model.pairs import may_meet
from anysim.model.world import (
    Actuation,
    Actuator,
    Body,
    BodyKind,
    Camera,
    Constraint,
    ConstraintKind,
    ControlMode,
    EntityKind,
    Geom,
    HeightFieldShape,
    Joint,
    MeshShape,
    Plane,
    SpatialTendon,
    Tendon,
    World,
)

_FEW = 100
"""So many bodies are asked at a time whether they can touch anything."""

_GIVES_WAY = "gives way as its file says"

Rows = tuple[tuple[C, object, str], ...]
"""A capability, whether it is needed, and why, in words that follow the name of the thing."""


_KEYS: Mapping[C, str] = {
    C.SOLVER_SETTINGS: ".solver",
    C.BODY_DAMPING: ".damping",
    C.RESTITUTION: ".restitution",
    C.TORSIONAL_FRICTION: ".contact.torsional_friction",
    C.RENDER_LIGHTS: ".lights",
    C.RENDER_SHADOWS: ".scenery.shadows",
}
"""The key of a thing that asks for a capability; the thing itself asks for the others."""


def needs_of(world: World) -> list[Need]:
    """Every capability the world needs, once, with the first thing that needs it and the key that asks for it."""
    found: dict[C, Need] = {}
    for what, path, rows in _things(world):
        for capability, needed, why in rows:
            if needed and capability not in found:
                found[capability] = Need(capability, f"{what} {why}".strip(), path + _KEYS.get(capability, ""))
    return list(found.values())


def _things(world: World) -> Iterator[tuple[str, str, Rows]]:
    """Everything in a world that may need a capability, by its name and its path in the spec."""
    path = _paths(world)
    links = [joint.body for joint in world.joints]
    yield from ((f"body '{body.name}'", path[index], _of_body(body)) for index, body in enumerate(world.bodies))
    yield from ((f"joint '{joint.name}'", path[joint.body], _of_joint(world, joint)) for joint in world.joints)
    yield from ((f"tendon '{t.name}'", path[links[t.joints[0]]], _of_tendon(t)) for t in world.tendons)
    for strung in world.spatial_tendons:
        yield f"tendon '{strung.name}'", path[max(strung.bodies)], _of_spatial_tendon(strung)
    yield from ((f"constraint '{c.name}'", path[c.body], _of_constraint(c)) for c in world.constraints)
    yield from ((f"drive '{a.name}'", path[links[a.joint]], _of_drive(a)) for a in world.actuators)
    if world.actuators:
        yield "physics.actuation", "physics.actuation", _of_actuation(world.physics.actuation)
    if world.physics.velocity_limits:
        for actuator in world.actuators:
            limited = isfinite(world.joints[actuator.joint].velocity_limit)
            needs = ((C.VELOCITY_LIMITS, limited, "heeds its joint's velocity limit"),)
            yield f"drive '{actuator.name}'", "physics.velocity_limits", needs
    yield from _contacts(world, path)
    yield from ((f"geom '{geom.name}'", path[geom.body], _of_geom(geom)) for geom in world.geoms if geom.collides)
    for slot in world.slots:
        needs = ((C.VARYING_ENTITIES, True, "is not the same in every env"),)
        yield f"'{slot.name}'", f"world.objects.{slot.category}", needs
    for sensor in world.contact_sensors:
        needs = ((C.CONTACT_SENSORS, True, ""),)
        yield f"contact sensor '{sensor.name}'", f"world.contact_sensors.{sensor.name}", needs
    shows = next((camera.name for camera in world.cameras if "rgb" in camera.channels), None)
    if shows is not None:
        yield f"camera '{shows}'", "world", _of_light(world)
    for camera in world.cameras:
        yield f"camera '{camera.name}'", f"world.cameras.{camera.name}.channels", _of_camera(world, camera)


def _paths(world: World) -> dict[int, str]:
    """For each body the path of what it belongs to; the ground's for what is fixed to the world."""
    found = {WORLD: "world.terrain"} | dict.fromkeys(range(len(world.bodies)), "world")
    for entity in world.entities:
        kind = "robots" if entity.kind is EntityKind.ROBOT else "objects"
        own = f"world.{kind}.{entity.category or entity.name}"
        for body in range(entity.body_start, entity.body_stop):
            found[body] = "world.room" if entity.source.startswith("room:") else own
    return found


def _of_body(body: Body) -> Rows:
    own = "has `solver` settings of its own; `engine.options` has those of a whole engine"
    return (
        (C.RIGID_BODIES, body.kind is BodyKind.FREE, "is free"),
        (C.ARTICULATIONS, body.kind is BodyKind.LINK, "is a link"),
        (C.GRAVITY_COMPENSATION, body.gravity_compensation, "is gravity compensated"),
        (C.BODY_DAMPING, any(body.damping), "is damped"),
        (C.SOLVER_SETTINGS, body.solver is not None, own),
    )


def _of_joint(world: World, joint: Joint) -> Rows:
    leader = "" if joint.mimic is None else world.joints[joint.mimic.joint].name
    return (
        (C.MIMIC_JOINTS, joint.mimic is not None, f"follows '{leader}'"),
        (C.MIMIC_CURVES, joint.mimic is not None and joint.mimic.curve, f"follows '{leader}' by a curve"),
        (C.JOINT_FRICTION, joint.friction > 0, "has dry friction"),
        (C.JOINT_SPRINGS, joint.stiffness != 0, "has a spring"),
        (C.ARMATURE, joint.armature > 0, "has armature"),
        (C.JOINT_LIMITS, isfinite(joint.lower) or isfinite(joint.upper), "is limited"),
        (C.COMPLIANCE, joint.limit_compliance or joint.friction_compliance or joint.mimic_compliance, _GIVES_WAY),
    )


def _of_tendon(tendon: Tendon) -> Rows:
    limited = isfinite(tendon.lower) or isfinite(tendon.upper)
    own = (
        "is held"
        if tendon.lower == tendon.upper
        else "is limited"
        if limited
        else "has dry friction"
        if tendon.friction
        else "has armature"
    )
    return (
        (C.TENDONS, tendon.stiffness or tendon.damping, "pulls at joints"),
        (C.TENDON_LIMITS, limited or tendon.friction or tendon.armature, own),
        (C.COMPLIANCE, tendon.limit_compliance or tendon.friction_compliance, _GIVES_WAY),
    )


def _of_spatial_tendon(tendon: SpatialTendon) -> Rows:
    gives_way = tendon.limit_compliance or tendon.friction_compliance
    return ((C.SPATIAL_TENDONS, True, "runs through space"), (C.COMPLIANCE, gives_way, _GIVES_WAY))


def _of_constraint(constraint: Constraint) -> Rows:
    welded = constraint.kind is ConstraintKind.WELD
    return (
        (C.WELDS, welded, "holds two frames together"),
        (C.CONNECTS, not welded, "holds two points together"),
        (C.COMPLIANCE, constraint.compliance or constraint.turn_scale != 1.0, _GIVES_WAY),
    )


def _of_drive(actuator: Actuator) -> Rows:
    return (
        (C.CONTROL_POSITION, actuator.mode is ControlMode.POSITION, "is position controlled"),
        (C.CONTROL_VELOCITY, actuator.mode is ControlMode.VELOCITY, "is velocity controlled"),
        (C.CONTROL_EFFORT, actuator.mode is ControlMode.EFFORT, "is effort controlled"),
        (C.EFFORT_LIMITS, isfinite(actuator.effort_limit), "is limited"),
        (C.TENDON_DRIVES, actuator.shares, "pulls at a tendon of several joints"),
    )


def _of_actuation(actuation: Actuation) -> Rows:
    return (
        (C.ACTUATION_EXPLICIT, actuation is Actuation.EXPLICIT_PD, f"is {actuation}"),
        (C.ACTUATION_NATIVE, actuation is Actuation.NATIVE, f"is {actuation}"),
    )


def _contacts(world: World, path: Mapping[int, str]) -> Iterator[tuple[str, str, Rows]]:
    """What can touch something fixed, and what something that moves: the first of each."""
    names = {geom.body: geom.name for geom in reversed(world.geoms) if geom.collides}
    bodies = np.array(sorted(names), dtype=int)
    fixed = np.array([b == WORLD or world.bodies[b].kind is BodyKind.STATIC for b in bodies.tolist()], dtype=bool)
    moving = bodies[~fixed]
    for capability, partners in ((C.CONTACTS_STATIC, bodies[fixed]), (C.CONTACTS_MOVING, moving)):
        for start in range(0, len(moving), _FEW):  # of thousands the first will meet, or were excluded for a reason
            some = moving[start : start + _FEW]
            pairs = np.argwhere(may_meet(world, some, partners))
            if len(pairs):
                body, other = int(some[pairs[0][0]]), int(partners[pairs[0][1]])
                why = f"collides with '{names[other]}'"
                yield f"geom '{names[body]}'", path[body], ((capability, True, why),)
                break


def _of_geom(geom: Geom) -> Rows:
    mesh, surface = isinstance(geom.shape, MeshShape), geom.surface
    concave = isinstance(geom.shape, MeshShape) and geom.shape.concave
    thing = concave and isinstance(geom.shape, MeshShape) and geom.shape.bounded
    seen = "`kind: heightfield` with the same `file` is its heights seen from above"
    instead = "`collision: decompose` collides as convex pieces of it" if thing else seen
    return (
        (C.TERRAIN_PLANE, isinstance(geom.shape, Plane), "is a plane"),
        (C.TERRAIN_HEIGHTFIELD, isinstance(geom.shape, HeightFieldShape), "is a height field"),
        (C.TERRAIN_TRIMESH, concave, f"is a triangle mesh; {instead}"),
        (C.SHAPE_MESH, mesh and not concave, "is a mesh"),
        (C.RESTITUTION, surface.restitution > 0, "bounces"),
        (C.TORSIONAL_FRICTION, surface.torsional, "has torsional friction"),
        (C.COMPLIANCE, surface.compliance, _GIVES_WAY),
    )


def _of_light(world: World) -> Rows:
    several = len(world.lights) > 1 or any(light.position is not None for light in world.lights)
    return (
        (C.RENDER_LIGHTS, several and world.lights != DEFAULT_LIGHTS, f"shows {len(world.lights)} lights"),
        (C.RENDER_SHADOWS, world.scenery.shadows, "shows shadows"),
    )


def _of_camera(world: World, camera: Camera) -> Rows:
    rgb, texture, material = ("rgb" in camera.channels, world.textures[:1], world.materials[:1])
    return (
        *((C(f"render: {channel}"), True, f"gives {channel}") for channel in camera.channels),
        (C.TEXTURES, rgb and texture, f"sees the texture '{texture[0].name if texture else ''}'"),
        (C.MATERIALS, rgb and material, f"sees the material '{material[0].name if material else ''}'"),
    )


def crowded(world: World, most: int, *, shapes: bool) -> list[str]:
    """Why entities with more joints, and further shapes of a body where those count, are too large: a reason each."""
    further = Counter(geom.body for geom in world.geoms if geom.collides and shapes)
    found: list[str] = []
    for entity in world.entities:
        joints = entity.joint_stop - entity.joint_start
        more = sum(max(0, further[body] - 1) for body in range(entity.body_start, entity.body_stop))
        if joints and joints + more > most:
            and_shapes = f" and {more} further shapes on its bodies" if more else ""
            found.append(f"'{entity.name}' has {joints} joints{and_shapes}, {most} at most")
    return found


def check_masses(world: World) -> None:
    """Refuse bodies that move and have no mass or inertia: engines let them hang, fall through or explode.

    Raises:
        EngineError: names the first of them.
    """
    for body in world.bodies:
        if body.kind is not BodyKind.STATIC and not (body.inertial.mass > 0 and min(body.inertial.inertia[:3]) > 0):
            lacks = "mass" if not body.inertial.mass > 0 else "inertia about each axis"
            raise EngineError(f"body '{body.name}' moves and has no {lacks}; give it some, or make it static")


def check_drives(world: World) -> None:
    """Refuse velocity limits that no drive can keep.

    Raises:
        EngineError: velocity limits are enforced on a position drive without damping, which asks for no velocity.
    """
    if world.physics.velocity_limits:
        for actuator in world.actuators:
            limit = world.joints[actuator.joint].velocity_limit
            if np.isfinite(limit) and actuator.kd == 0 and actuator.mode is not ControlMode.EFFORT:
                raise EngineError(
                    f"drive '{actuator.name}' has kd = 0 and cannot keep the velocity limit of {limit:g}; give it "
                    f"damping, or set physics.velocity_limits: ignore"
                )


def speed_bound(damping: Array, limit: Array) -> Array:
    """Bound on |kp (q* - q) + kd qd*|: kd times the velocity limit; none without damping or without a limit."""
    bound = np.full(np.broadcast_shapes(damping.shape, limit.shape), np.inf)
    return np.multiply(damping, limit, out=bound, where=damping > 0)
