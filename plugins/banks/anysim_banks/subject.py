"""The subject of a bank: one affordance of an entity, its body alone, and what stands beside it."""

from dataclasses import dataclass, replace

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION, WORLD, Array
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.model.affordance_lookup import FoundAffordance, affordances_of, find_affordance, resolve_affordance
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.hash import world_hash
from anysim.model.slots import single
from anysim.model.world import ORIGIN, Body, BodyKind, Entity, Geom, Inertial, JointType, Vec3, World
from anysim_banks.pieces import Piece, piece_of

GRASPED = frozenset(
    {AffordanceKind.HANDLE, AffordanceKind.RIM, AffordanceKind.BODY, AffordanceKind.LEVER, AffordanceKind.TIP}
)
"""Kinds that fingers close on; the others are pressed, or something goes into them."""

Region = tuple[Vec3, float]


@dataclass(frozen=True, eq=False)
class Subject:
    """What grasps are sampled on and tried with.

    Attributes:
        asset: where it comes from, a URI or the name of its entity.
        affordance: in the asset's own names.
        frame: (7,) of the affordance in its body's frame.
        pieces: what is taken hold of, in the body's frame.
        around: all that collides of the entity, at its joints' initial positions, in the body's frame.
        body: the body, to be held freely: its mass and inertia.
        world: the body alone, with what of it collides.
        pull: what its joint lets it move along at the affordance, unit, in the body's frame; None: it is carried.
        hash: a digest of the entity and the affordance.
        region: a point in the affordance's frame and the radius about it [m] that grasps keep to; None: no bounds.
    """

    asset: str
    affordance: Affordance
    frame: Array
    pieces: tuple[Piece, ...]
    around: tuple[Piece, ...]
    body: Body
    world: World
    pull: Array | None
    hash: str
    region: Region | None = None


def subjects(world: World, entity: str, only: str = "") -> list[Subject]:
    """All affordances of an entity that fingers close on, or the one that is named.

    Raises:
        NameLookupError: there is no such entity or affordance.
        AssetError: it affords nothing to close on, or what it affords has no mass or no convex piece.
    """
    if only:
        return [subject(world, find_affordance(world, f"{entity}.{only}"))]
    number = _number(world, entity)
    specs = [one for one in affordances_of(world, number) if one.kind in GRASPED]
    if not specs:
        raise AssetError(f"'{entity}' has no affordance that fingers close on; declare one in its asset")
    return [subject(world, resolve_affordance(world, number, one)) for one in specs]


def subject_of(world: World, entity: str, spec: Affordance, region: Region | None) -> Subject:
    """An affordance that its asset does not declare; one without pieces is about all that collides of its link.

    Raises:
        NameLookupError: there is no such entity, link or piece.
        AssetError: as of `subject`.
    """
    number = _number(world, entity)
    found = resolve_affordance(world, number, spec)
    if not spec.pieces:
        whole = (g for g in world.body_geoms[found.frame.body] if world.geoms[g].collides)
        found = found._replace(geoms=tuple(whole))
    return subject(world, found, region)


def _number(world: World, entity: str) -> int:
    found = world.entity_numbers.get(entity)
    return single(world, entity).entities[0] if found is None else found


def subject(world: World, found: FoundAffordance, region: Region | None = None) -> Subject:
    """One affordance, apart from the World that it was found in.

    Raises:
        AssetError: it is not for closing on, or has no mass or no convex piece.
    """
    owner, spec, number = world.entities[found.entity], found.spec, found.frame.body
    where = f"{owner.name}.{spec.name}"
    if spec.kind not in GRASPED:
        raise AssetError(f"'{where}' is a {spec.kind}, which fingers do not close on; it has no bank of grasps")
    pieces = tuple(piece for i in found.geoms if world.geoms[i].collides and (piece := piece_of(world, i)))
    if not pieces:
        raise AssetError(f"'{where}' has no convex piece that collides; name some in its `pieces`")
    body = world.bodies[number]
    if body.inertial.mass <= 0:
        raise AssetError(f"'{where}' has no mass, so that holding it cannot be tried; give its object a mass")
    alone = Body("", BodyKind.FREE, inertial=body.inertial)
    geoms = tuple(_plain(g, 0) for g in world.geoms if g.body == number and g.collides)
    meshes = tuple(m for m in world.meshes if any(getattr(g.shape, "mesh", "") == m.name for g in geoms))
    frame = np.array([*found.frame.position, *found.frame.quaternion])
    return Subject(
        owner.source or owner.name,
        spec,
        frame,
        pieces,
        tuple(_around(world, owner, number)),
        alone,
        World("subject", bodies=(alone,), geoms=geoms, meshes=meshes),
        _pull(world, found),
        _hash(world, owner, found, region),
        region,
    )


def _plain(geom: Geom, body: int) -> Geom:
    """A geom without looks and name."""
    return Geom("", body, geom.shape, geom.position, geom.quaternion, surface=geom.surface)


def _around(world: World, owner: Entity, number: int) -> list[Piece]:
    to_body = P.inverse(world.initial_body_pose[number])
    found: list[Piece] = []
    for body in range(owner.body_start, owner.body_stop):
        relative = P.compose(to_body, world.initial_body_pose[body])
        for geom in world.body_geoms[body]:
            piece = piece_of(world, geom) if world.geoms[geom].collides else None
            if piece is not None:
                found.append(piece._replace(pose=P.compose(relative, piece.pose)))
    return found


def _pull(world: World, found: FoundAffordance) -> Array | None:
    if found.joint < 0:
        return None
    joint = world.joints[found.joint]
    axis = np.array(joint.axis)
    if joint.type is JointType.PRISMATIC:
        return axis
    along = np.cross(axis, np.array(found.frame.position) - np.array(joint.anchor))
    length = float(np.linalg.norm(along))
    return along / length if length > 1e-6 else None


def _hash(world: World, owner: Entity, found: FoundAffordance, region: Region | None) -> str:
    """Of what decides how a grasp goes: shapes, surfaces, masses and joints; not looks, names or where it is."""
    first = owner.body_start
    own = range(first, owner.body_stop)
    bodies = [
        replace(b, name="", parent=b.parent - first if b.parent in own else WORLD)
        for b in world.bodies[first : owner.body_stop]
    ]
    if found.frame.body != first:  # whether it is fixed or not does not matter to what is held of it
        bodies[0] = replace(bodies[0], inertial=Inertial(0.0))
    bodies[0] = replace(bodies[0], kind=BodyKind.FREE, position=ORIGIN, quaternion=IDENTITY_QUATERNION)
    joints = world.joints[owner.joint_start : owner.joint_stop]
    geoms = [_plain(g, g.body - first) for g in world.geoms if g.body in own and g.collides]
    names = {getattr(g.shape, "mesh", "") for g in geoms}
    alone = World(
        f"{found.spec} {region}",
        bodies=tuple(bodies),
        joints=tuple(replace(j, name="", body=j.body - first, mimic=None) for j in joints),
        geoms=tuple(geoms),
        meshes=tuple(m for m in world.meshes if m.name in names),
    )
    return world_hash(alone)
