"""The subject of a bank: one affordance of an entity, its body alone, and what stands beside it."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from anysim.conventions import Array
from anysim.errors import AssetError, listing
from anysim.math import pose as P
from anysim.model.affordance_lookup import (
    FoundAffordance,
    affordances_of,
    asset_hash,
    collision_geom,
    find_affordance,
    resolve_affordance,
)
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.slots import single
from anysim.model.world import Body, BodyKind, Entity, JointType, Vec3, World
from anysim_banks.pieces import Piece, piece_of

GRASPED = frozenset({AffordanceKind.HANDLE, AffordanceKind.RIM, AffordanceKind.BODY, AffordanceKind.LEVER})
"""Kinds that fingers close on; the others are pressed, go into something, or have something go into or hang on them."""

STATIONS = 5
"""Points of a joint's way."""
OPENED = 0.8
"""Of its range."""

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
        way: (S, 7) of the body in the asset's frame along the way of the joint that moves it, from its initial position
            on; one where it is carried.
        pull: what its joint lets it move along at the affordance, unit, in the body's frame; None: it is carried.
        hash: a digest of the entity (`anysim.model.affordance_lookup.asset_hash`).
        link: the body's number among the entity's.
        region: a point in the affordance's frame and the radius about it [m] that grasps keep to; None: no bounds.
    """

    asset: str
    affordance: Affordance
    frame: Array
    pieces: tuple[Piece, ...]
    around: tuple[Piece, ...]
    body: Body
    world: World
    way: Array
    pull: Array | None
    hash: str
    link: int
    region: Region | None = None

    @property
    def place(self) -> str:
        """A digest of the affordance and its region: where on the asset grasps are looked for."""
        return hashlib.sha256(f"{self.affordance} {self.region}".encode()).hexdigest()


def subjects(world: World, entity: str, only: str = "") -> list[Subject]:
    """All affordances of an entity that fingers close on, or the one that is named.

    Raises:
        NameLookupError: there is no such entity or affordance.
        AssetError: it affords nothing to close on, or what it affords has no mass or no convex piece.
    """
    if only:
        return [subject(world, find_affordance(world, f"{entity}.{only}"))]
    number = _number(world, entity)
    specs = graspable(world, number)
    if not specs:
        has = listing([one.name for one in affordances_of(world, number)])
        raise AssetError(
            f"'{entity}' has no affordance that fingers close on (it has: {has}); declare one in its asset"
        )
    return [subject(world, resolve_affordance(world, number, one)) for one in specs]


def graspable(world: World, entity: int) -> list[Affordance]:
    """What an entity, by its index, affords fingers to close on."""
    return [a for a in affordances_of(world, entity) if a.kind in GRASPED]


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
    geoms = tuple(collision_geom(g, 0) for g in world.geoms if g.body == number and g.collides)
    meshes = tuple(m for m in world.meshes if any(getattr(g.shape, "mesh", "") == m.name for g in geoms))
    frame = np.array([*found.frame.position, *found.frame.quaternion])
    return Subject(
        owner.source or owner.name,
        spec,
        frame,
        pieces,
        tuple(piece for _, piece in pieces_about(world, owner, number)),
        alone,
        World("subject", bodies=(alone,), geoms=geoms, meshes=meshes),
        _way(world, found),
        _pull(world, found),
        asset_hash(world, owner, number),
        number - owner.body_start,
        region,
    )


def pieces_about(world: World, owner: Entity, number: int) -> Iterator[tuple[int, Piece]]:
    """The geoms of an entity that collide, each with its piece in the frame of a body, as they are built."""
    to_body = P.inverse(world.initial_body_pose[number])
    for body in range(owner.body_start, owner.body_stop):
        relative = P.compose(to_body, world.initial_body_pose[body])
        for geom in world.body_geoms[body]:
            piece = piece_of(world, geom) if world.geoms[geom].collides else None
            if piece is not None:
                yield geom, piece._replace(pose=P.compose(relative, piece.pose))


def _way(world: World, found: FoundAffordance) -> Array:
    """From its initial position towards its farther limit, for as much of that as skills open a part."""
    joint_pos = np.array([[joint.initial for joint in world.joints]])
    if found.joint >= 0:
        joint = world.joints[found.joint]
        end = max(joint.lower, joint.upper, key=lambda limit: abs(limit - joint.initial))
        joint_pos = np.tile(joint_pos, (STATIONS, 1))
        if np.isfinite(end):
            joint_pos[:, found.joint] += np.linspace(0.0, OPENED, STATIONS) * (end - joint.initial)
    poses = forward_kinematics(world, np.tile(world.initial_body_pose, (len(joint_pos), 1, 1)), joint_pos)
    return P.compose(P.inverse(poses[:, world.entities[found.entity].root]), poses[:, found.frame.body])


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
