"""Affordances of a World by name, with indices in place of their assets' names.

A free rigid object of which nothing is said has the affordance `body`: all that it collides with.
"""

from dataclasses import replace
from typing import NamedTuple

from anysim.conventions import IDENTITY_QUATERNION, WORLD
from anysim.errors import NameLookupError, listing, suggest
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.frames import FixedFrame, find_frame
from anysim.model.hash import world_hash
from anysim.model.slots import members
from anysim.model.world import ORIGIN, BodyKind, Entity, Geom, Inertial, World

BODY = "body"
"""The affordance of a free rigid object of which nothing was said."""


class FoundAffordance(NamedTuple):
    """An affordance of one entity of a World: indices of its geoms and of its joint (-1: none), and its frame."""

    entity: int
    spec: Affordance
    frame: FixedFrame
    geoms: tuple[int, ...]
    joint: int


def affordances_of(world: World, entity: int) -> tuple[Affordance, ...]:
    """What an entity affords: what its asset declares, and `body` for a free rigid object that declares none of these.

    `entity` is an index into `World.entities`.
    """
    owner = world.entities[entity]
    declared = owner.affordances
    whole = owner.joint_start == owner.joint_stop and world.bodies[owner.root].kind is BodyKind.FREE
    if not whole or any(one.kind is AffordanceKind.BODY for one in declared):
        return declared
    pieces = tuple(_local(world.geoms[i].name, owner) for i in world.body_geoms[owner.root] if world.geoms[i].collides)
    return (*declared, Affordance(BODY, AffordanceKind.BODY, pieces=pieces, use=("carry",))) if pieces else declared


def find_affordance(world: World, name: str) -> FoundAffordance:
    """An affordance by name, such as `cabinet.drawer_1.handle` or `cube.body`.

    The bare name of an entity stands for the only affordance that it has.

    Raises:
        NameLookupError: there is no such entity or affordance, or several; lists those that there are.
    """
    owner, _, local = name.partition(".")
    slots = members(world, owner)
    entities = [e for slot in slots for e in slot.entities]
    if len(entities) != 1:
        known = [e.name for e in world.entities]
        why = f"stands for {len(entities)} entities; name one of them" if entities else "is no entity"
        among = [world.entities[e].name for e in entities] or known
        raise NameLookupError(f"'{owner}' {why}{suggest(owner, among)} (entities: {listing(among)})")
    owned = affordances_of(world, entities[0])
    found = [one for one in owned if one.name == local or (not local and len(owned) == 1)]
    if not found:
        names = [one.name for one in owned]
        has = f"affordances: {listing(names, 20)}" if names else "it has none; its asset declares them"
        wanted = f"has no affordance '{local}'" if local else f"has {len(names)} affordances; name one of them"
        raise NameLookupError(f"'{owner}' {wanted}{suggest(local, names)} ({has})")
    return resolve_affordance(world, entities[0], found[0])


def resolve_affordance(world: World, entity: int, spec: Affordance) -> FoundAffordance:
    """An affordance on an entity by its index, whether the entity's asset declares it or not.

    Raises:
        NameLookupError: the entity has no such link, site or geom.
    """
    owner = world.entities[entity]
    frame = find_frame(world, f"{owner.name}.{spec.frame}" if spec.frame else owner.name)
    wanted = {f"{owner.name}.{piece}" if piece else owner.name for piece in spec.pieces}
    own = range(owner.body_start, owner.body_stop)
    geoms = tuple(i for i, geom in enumerate(world.geoms) if geom.body in own and geom.name in wanted)
    if lost := sorted(wanted - {world.geoms[i].name for i in geoms}):
        names = [_local(geom.name, owner) for geom in world.geoms if geom.body in own and geom.collides]
        part = _local(lost[0], owner)
        raise NameLookupError(
            f"'{owner.name}' has no geom '{part}'{suggest(part, names)} (geoms: {listing(names, 20)})"
        )
    joints = range(owner.joint_start, owner.joint_stop)
    joint = next((i for i in joints if world.joints[i].name == f"{owner.name}.{spec.joint}"), -1)
    return FoundAffordance(entity, spec, frame, geoms, joint)


def asset_hash(world: World, owner: Entity, held: int) -> str:
    """A digest of what decides how an entity is grasped at its body `held`: shapes, surfaces, masses and joints.

    Looks, names, where it stands, and whether a root that is not held is fixed do not matter.
    """
    first, own = owner.body_start, range(owner.body_start, owner.body_stop)
    bodies = [replace(world.bodies[b], name="", parent=max(world.bodies[b].parent - first, WORLD)) for b in own]
    bodies[0] = replace(bodies[0], kind=BodyKind.FREE, position=ORIGIN, quaternion=IDENTITY_QUATERNION)
    if held != first:
        bodies[0] = replace(bodies[0], inertial=Inertial(0.0))
    joints = (replace(j, name="", body=j.body - first, mimic=None) for j in world.joints if j.body in own)
    geoms = tuple(collision_geom(g, g.body - first) for g in world.geoms if g.body in own and g.collides)
    meshes = tuple(m for m in world.meshes if m.name in {getattr(g.shape, "mesh", "") for g in geoms})
    return world_hash(World("asset", bodies=tuple(bodies), joints=tuple(joints), geoms=geoms, meshes=meshes))


def collision_geom(geom: Geom, body: int) -> Geom:
    """A geom on the body of another World, without looks and name."""
    return Geom("", body, geom.shape, geom.position, geom.quaternion, surface=geom.surface)


def _local(name: str, owner: Entity) -> str:
    return name.removeprefix(owner.name).removeprefix(".")
